"""The command line: what it prints, what it writes, what it refuses."""

from __future__ import annotations

import json
import os
import re
import socket
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from engine.scenario import library, toml
from server import serving
from server.cli import main
from server.recovery import DATABASE
from server.store import Store

QUICK = ["--set", "duration_s=120", "--set", "report_interval_s=4", "--workers", "1"]


def test_run_prints_a_table_and_writes_the_result_directory(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "result"
    assert main(["run", "first-look", "--trials", "2", "--seed", "5", "--out", str(out), *QUICK]) == 0
    printed = capsys.readouterr()
    assert "100%" in printed.err
    for word in ("dead_reckoning", "cekf", "nekf", "scout", "RMSE m", "seed 5"):
        assert word in printed.out
    result = json.loads((out / "result.json").read_text())
    assert set(result) == {"schema", "scenario", "seed", "trials", "algorithms", "claims"}
    assert (result["schema"], result["seed"], result["trials"]) == (1, 5, 2)
    scout = result["algorithms"]["nekf"]["subjects"]["scout"]
    assert {"rmse_m", "final_rmse_m", "sigma_m", "final_sigma_m", "anees", "anees_interval", "consistent"} <= set(scout)
    assert scout["max_deviation_m"] > 0
    assert {"sent", "received", "bytes_per_packet", "floats_per_packet"} <= set(result["algorithms"]["nekf"]["packets"])
    with np.load(out / "arrays.npz") as arrays:
        T = len(arrays["time_s"])
        assert arrays["truth/scout"].shape == arrays["nekf/scout/mean"].shape == (2, T, 2)
        assert arrays["nekf/scout/cov"].shape == (2, T, 2, 2)
        assert all(arrays[key].dtype == np.float64 for key in arrays.files)


def test_the_workers_do_not_change_the_numbers(tmp_path: Path):
    for workers in ("1", "2"):
        command = ["run", "first-look", "--trials", "60", "--algorithms", "nekf", "--set", "duration_s=60"]
        assert main([*command, "--workers", workers, "--out", str(tmp_path / workers)]) == 0
    with np.load(tmp_path / "1" / "arrays.npz") as one, np.load(tmp_path / "2" / "arrays.npz") as two:
        assert set(one.files) == set(two.files)
        for key in one.files:
            np.testing.assert_array_equal(one[key], two[key])


def test_statistics_of_many_trials_are_kept_without_their_tracks(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    command = ["run", "first-look", "--trials", "60", "--algorithms", "dead_reckoning", "--statistics", *QUICK]
    assert main([*command, "--out", str(tmp_path / "run")]) == 0
    assert "60 trials" in capsys.readouterr().out
    told = json.loads((tmp_path / "run" / "result.json").read_text())
    assert told["algorithms"]["dead_reckoning"]["subjects"]["scout"]["error_over_trials"]["trials"] == 60
    assert not (tmp_path / "run" / "arrays.npz").exists()
    assert main([*command, "--sweep", "network.loss=0,0.5", "--out", str(tmp_path / "sweep")]) == 0
    assert json.loads((tmp_path / "sweep" / "network.loss=0.5" / "result.json").read_text())["trials"] == 60


def test_a_scenario_is_a_name_a_file_or_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    file = tmp_path / "scenario.toml"
    file.write_text(toml.dumps(library.shipped("first-look")))
    for source in (str(file), str(tmp_path)):
        assert main(["run", source, "--trials", "1", "--algorithms", "dead_reckoning", *QUICK]) == 0
        assert "First look" in capsys.readouterr().out


def test_a_written_log_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "log"
    assert main(["log", "first-look", "--out", str(out), *QUICK[:4]]) == 0
    assert list(out.glob("*.csv"))
    assert main(["run", str(out), "--algorithms", "cekf"]) == 0
    assert "scout" in capsys.readouterr().out


def test_lists_are_for_people_and_for_machines(capsys: pytest.CaptureFixture[str]):
    assert main(["list", "algorithms"]) == 0
    assert "Naive EKF" in capsys.readouterr().out
    assert main(["list", "scenarios", "--json"]) == 0
    assert [e["name"] for e in json.loads(capsys.readouterr().out)] == library.names()


def test_check_fails_when_a_claim_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    base = toml.override(library.shipped("first-look"), {"duration_s": 120, "trials": 2, "report_interval_s": 4})
    claim = {"text": "It flies", "metric": "rmse_m", "algorithm": "cekf", "subject": "scout", "operator": "<"}
    for bound, code, word in ((1e6, 0, "no claim failed"), (0.0, 1, "1 claim failed")):
        path = tmp_path / "s.toml"
        path.write_text(toml.dumps(toml.override(base, {"claims": [claim | {"bound": bound}]})))
        assert main(["check", str(path), "--workers", "1"]) == code
        assert word in capsys.readouterr().out


def test_report_writes_one_page(tmp_path: Path):
    out = tmp_path / "result"
    assert main(["run", "first-look", "--trials", "1", "--out", str(out), *QUICK]) == 0
    assert main(["report", str(out), "--out", str(tmp_path / "r.html")]) == 0
    page = (tmp_path / "r.html").read_text()
    assert "<svg" in page and "scout" in page and "coopnav" in page
    assert "http://" not in page and "https://" not in page


@pytest.mark.parametrize(
    ("command", "word"),
    [
        (["run", "no-such-mission"], "no-such-mission"),
        (["run", "../first-look"], "first-look"),
        (["run", "/nowhere/x.toml"], "/nowhere/x.toml"),
        (["run", "first-look", "--trials", "0"], "trials"),
        (["run", "first-look", "--trials", "1000000"], "trials"),
        (["run", "first-look", "--trials", "many"], "trials"),
        (["run", "first-look", "--algorithms", "teleportation"], "teleportation"),
        (["run", "first-look", "--set", "network.lss=1"], "network.lss"),
        (["run", "first-look", "--set", "network.loss=nan"], "network.loss"),
        (["run", "first-look", "--set", "network.loss"], "key=value"),
        (["check"], "--all"),
        (["check", "no-such-mission"], "no-such-mission"),
        (["log", "first-look", "--out", "/dev/null"], "/dev/null"),
        (["report", "no-such-job", "--out", "r.html"], "no-such-job"),
        (["serve", "--host", "no.such.host.invalid"], "no.such.host.invalid"),
        (["serve", "--data", "/dev/null/data"], "/dev/null/data"),
    ],
)
def test_bad_input_ends_with_2_and_a_sentence(
    command: list[str], word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    assert main(command) == 2
    error = capsys.readouterr().err
    assert word in error and "Traceback" not in error
    assert list(tmp_path.iterdir()) == []


def test_malformed_toml_is_told_with_its_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "bad.toml"
    path.write_text("title = = 1\n")
    assert main(["run", str(path)]) == 2
    error = capsys.readouterr().err
    assert "line 1" in error and "bad.toml" in error


def test_a_port_in_use_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert main(["serve", "--port", port, "--data", str(tmp_path)]) == 2
    assert "--port" in capsys.readouterr().err


def test_a_data_folder_has_one_server(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with serving.occupy(tmp_path):
        assert main(["serve", "--port", "0", "--data", str(tmp_path)]) == 2
    assert f"process {os.getpid()} keeps its data" in capsys.readouterr().err
    serving.occupy(tmp_path).close()


def test_data_of_a_later_version_is_told_and_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    Store(tmp_path / DATABASE).close()
    with sqlite3.connect(tmp_path / DATABASE) as db:
        db.execute("PRAGMA user_version=99")
    assert main(["serve", "--port", "0", "--data", str(tmp_path)]) == 2
    assert "later version" in capsys.readouterr().err
    assert sqlite3.connect(tmp_path / DATABASE).execute("PRAGMA user_version").fetchone() == (99,)


def test_an_unknown_command_is_told(capsys: pytest.CaptureFixture[str]):
    for command in (
        [],
        ["fly"],
        ["serve", "--port", "99999"],
        ["list", "vessels"],
        ["run", "first-look", "--workers", "0"],
        ["run", "first-look", "--workers", "two"],
        ["serve", "--port", "http"],
        ["serve", "--keep-days", "nan"],
        ["serve", "--keep-gb", "-1"],
    ):
        with pytest.raises(SystemExit) as end:
            main(command)
        assert end.value.code == 2
        told = capsys.readouterr().err
        assert not command or command[-1] in told
        assert not re.search(r"\b_\w+|Traceback", told), "names of ours are nobody's business"
