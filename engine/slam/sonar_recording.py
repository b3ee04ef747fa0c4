"""Recorded waveforms as a mission: a person's own hydrophone file and a row of a table for every transmission."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.recorded import read_records, read_waveform
from engine.mission.tables import Sheet, sheet, stacked
from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.recording import SonarRecording
from engine.scenario.slam import MAX_POSES, SlamScenario, fitting
from engine.slam.hearing import hear, sonar_of
from engine.slam.log import SlamLog
from engine.slam.recorded import Recorded


def read_sonar(scenario: SlamScenario, mission: SonarRecording, folder: Path) -> Recorded:
    """The mission in a recording of waveforms. Raises ScenarioError for what cannot be read, or asks for too much."""
    rows = sheet(folder / mission.pings, "mission.pings")
    time_s = rows.times(mission.time, mission.time_unit)
    poses = len(time_s)
    if not 2 <= poses <= MAX_POSES:
        message = f"{mission.pings} has {poses} transmissions"
        raise ScenarioError([Problem("mission.pings", message, f"give between 2 and {MAX_POSES}")])
    problems = list(fitting(scenario, poses))
    if problems:
        raise ScenarioError(problems)
    reckoned = stacked(rows, [mission.x, mission.y])
    fix_m, fixed = _fixes(rows, mission, reckoned)
    sonar = sonar_of(scenario.sonar)
    if mission.chirp is not None:
        sonar = replace(sonar, waveform=read_waveform(folder / mission.chirp, sonar, "mission.chirp"))
    starts = time_s if mission.start is None else rows.numbers(mission.start)
    records = read_records(folder / mission.records, sonar, starts, "mission.records", channel=mission.channel)
    dt = np.diff(time_s)
    pings, arrays = hear(
        scenario,
        mission.beacon,
        reckoned,
        sonar,
        float(np.median(dt)),
        lambda wanted: matched_filter(records[wanted], sonar, phat=scenario.sonar.phat),
    )
    stated = scenario.odometry.sigma_m
    sigma = np.full(poses - 1, stated) if stated is not None else np.maximum(scenario.odometry.drift_mps * dt, 1e-3)
    log = SlamLog(
        steps=np.diff(reckoned, axis=0),
        step_cov=np.square(sigma)[:, None, None] * np.eye(2),
        fix_m=fix_m,
        fix_sigma_m=scenario.fixes.sigma_m,
        fixed=fixed,
        pings=pings,
        arrays=arrays,
    )
    truth = {}
    if mission.truth_x is not None and mission.truth_y is not None:
        truth[mission.vehicle] = stacked(rows, [mission.truth_x, mission.truth_y])[None]
    if mission.beacon_m is not None:
        truth[mission.beacon] = np.tile(mission.beacon_m, (1, poses, 1))
    return Recorded(time_s - time_s[0], log, truth, ())


def _fixes(rows: Sheet, mission: SonarRecording, reckoned: np.ndarray) -> tuple[np.ndarray, tuple[int, ...]]:
    """What fixes read (P, 2), NaN where there was none, and the poses that have one.

    Without a fix at the first pose dead reckoning is taken to start where the vehicle is.
    """
    fix_m = np.full((len(reckoned), 2), np.nan)
    if mission.fix_x is not None and mission.fix_y is not None:
        fix_m = np.stack([rows.numbers(c, empty=True) for c in (mission.fix_x, mission.fix_y)], axis=-1)
    if np.isnan(fix_m[0]).any():
        fix_m[0] = reckoned[0]
    return fix_m, tuple(int(k) for k in np.flatnonzero(~np.isnan(fix_m).any(-1)))
