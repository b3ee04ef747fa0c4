"""Estimates of the target by those who hold one, in every trial: from cycle to cycle, arrival by arrival."""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum

import numpy as np

from engine.gaussian.forms import Moments
from engine.pursuit.arrivals import Surprise, update
from engine.pursuit.mission import PursuitMission
from engine.pursuit.options import FilterOptions
from engine.pursuit.sigma_points import Rule
from engine.pursuit.target import Motion, jitter, predict


class Update(IntEnum):
    """What a holder could do with what it knows: nothing, an estimate from some arrivals, or one from all."""

    NONE = 0
    PARTIAL = 1
    FULL = 2


class Tracker:
    """H holders of an estimate over [position, heading], each (trials, H, d+1), at three instants.

    prior: at the present cycle's ping, before it; fix: the same after all arrivals known by now, computed from the
    prior anew whenever one comes in, so that none counts twice; now: the fix predicted to the present.
    """

    def __init__(
        self,
        first: Moments,
        motion: Motion,
        sigma_m: float,
        jitter_s: float,
        rule: Rule,
        iterations: int,
        reports_s: np.ndarray,
    ) -> None:
        self.prior = self.fix = self.now = first
        self.now_s = self.ping_s = 0.0
        self._motion, self.sigma_m, self._jitter_s = motion, sigma_m, jitter_s
        self._rule, self._iterations = rule, iterations
        trials, H, n = first.mean.shape
        self._counts = np.zeros((trials, H), int)
        self._reports_s = reports_s
        self.mean = np.full((trials, H, len(reports_s), n - 1), np.nan)
        self.cov = np.full((trials, H, len(reports_s), n - 1, n - 1), np.nan)
        self._reported = 0

    @classmethod
    def of(cls, mission: PursuitMission, first: Moments, options: FilterOptions) -> Tracker:
        """A mission's tracker that begins with a belief of each holder, (trials, H, d+1)."""
        noise_m = mission.scenario.network.range_sigma_m if options.range_sigma_m is None else options.range_sigma_m
        motion = mission.motion if options.speed_mps is None else replace(mission.motion, speed_mps=options.speed_mps)
        jitter_s = mission.scenario.target.ping_jitter_s
        return cls(first, motion, noise_m, jitter_s, options.rule, options.iterations, mission.time_s)

    def advance(self, until_s: float) -> None:
        """Predict to a moment, reporting on the way; a report at that very moment waits for what happens then."""
        while self._reported < len(self._reports_s) and self._reports_s[self._reported] < until_s - 1e-9:
            self._to(self._reports_s[self._reported])
            self._report()
        self._to(until_s)

    def finish(self, until_s: float) -> None:
        """Predict to the end and make the last report."""
        self.advance(until_s)
        if self._reported < len(self._reports_s):
            self._report()

    def _to(self, moment_s: float) -> None:
        """Predict to a moment from the fix, in one go: every prediction makes a Gaussian of what is none."""
        if moment_s > self.now_s:
            self.now_s = float(moment_s)
            self.now = predict(self.fix, self._motion, self.now_s - self.ping_s, self._rule)

    def _report(self) -> None:
        d = self.mean.shape[-1]
        self.mean[:, :, self._reported] = self.now.mean[..., :d]
        self.cov[:, :, self._reported] = self.now.cov[..., :d, :d]
        self._reported += 1

    def begin(self) -> None:
        """A ping goes out at the present moment."""
        self.prior = self.fix = self.now
        self.ping_s = self.now_s
        self._counts = np.zeros_like(self._counts)

    def hear(self, arrivals_m: np.ndarray, known: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, Surprise]:
        """Take in what is known of the cycle's arrivals, known (trials, H, V), places (trials, 1 or H, V, d).

        The kind of update (trials, H) of each holder, and the fixes' surprise; who knows nothing new stays as it is.
        """
        counts = known.sum(axis=-1)
        news = (counts > self._counts) & (counts >= 2)
        kind = np.where(news, np.where(counts == known.shape[-1], Update.FULL, Update.PARTIAL), Update.NONE)
        self._counts = np.maximum(counts, self._counts)
        if not news.any():
            return kind, Surprise(np.full(known.shape, np.nan))
        fix, surprise = update(
            self.prior,
            arrivals_m,
            known,
            places,
            self.sigma_m,
            self._rule,
            self._iterations,
            jitter(self.prior, self._motion, self._jitter_s),
        )
        self.fix = _where(news, fix, self.fix)
        self.now = _where(news, predict(self.fix, self._motion, self.now_s - self.ping_s, self._rule), self.now)
        return kind, Surprise(np.where(news[..., None], surprise.white, np.nan))


def _where(which: np.ndarray, this: Moments, that: Moments) -> Moments:
    return Moments(
        np.where(which[..., None], this.mean, that.mean), np.where(which[..., None, None], this.cov, that.cov)
    )
