"""Tracks for other tools: what they read is what was estimated."""

from __future__ import annotations

import io
import zipfile

import numpy as np

from tests.server.living import Live

RUN = {"scenario": "first-look", "trials": 2, "algorithms": ["cekf", "nekf"], "set": {"duration_s": 60}}


def read(content: bytes) -> dict[str, np.ndarray]:
    with zipfile.ZipFile(io.BytesIO(content)) as found:
        return {name: np.loadtxt(io.BytesIO(found.read(name)), ndmin=2) for name in found.namelist()}


def test_every_track_of_a_trial_is_a_text_file_of_poses(live: Live):
    id = live.done(RUN)["id"]
    answer = live.http.get(f"/api/jobs/{id}/tracks", params={"trial": 1})
    assert answer.headers["content-type"] == "application/zip"
    assert f"{id}-tracks.zip" in answer.headers["content-disposition"]
    found = read(answer.content)
    names = [f"{name}-{subject}.txt" for name in ("truth", "cekf", "nekf") for subject in ("scout", "ship")]
    assert sorted(found) == sorted(names)
    arrays = np.load(io.BytesIO(live.http.get(f"/api/jobs/{id}/arrays").content))
    for key, name in (("truth/scout", "truth-scout.txt"), ("nekf/ship/mean", "nekf-ship.txt")):
        np.testing.assert_allclose(found[name][:, 0], arrays["time_s"], atol=1e-6)
        np.testing.assert_allclose(found[name][:, 1:3], arrays[key][1], atol=1e-6)
        assert np.all(found[name][:, 3:] == [0, 0, 0, 0, 1])
    first = read(live.http.get(f"/api/jobs/{id}/tracks").content)
    np.testing.assert_allclose(first["cekf-scout.txt"][:, 1:3], arrays["cekf/scout/mean"][0], atol=1e-6)
    rmse = np.sqrt(np.mean(np.sum((first["cekf-scout.txt"] - first["truth-scout.txt"])[:, 1:3] ** 2, axis=1)))
    told = live.http.get(f"/api/jobs/{id}/view").json()["algorithms"]["cekf"]["subjects"]["scout"]
    assert 0 < rmse <= told["distribution_m"][-1]


def test_a_trial_that_is_not_there_is_refused(live: Live):
    id = live.done(RUN)["id"]
    answer = live.http.get(f"/api/jobs/{id}/tracks", params={"trial": 2})
    assert answer.status_code == 422 and "0 to 1" in answer.json()["detail"]
    assert live.http.get(f"/api/jobs/{id}/tracks", params={"trial": -1}).status_code == 422
    assert live.http.get("/api/jobs/none/tracks").status_code == 404
