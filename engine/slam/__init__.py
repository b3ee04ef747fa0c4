"""Non-Gaussian SLAM on a Bayes tree: beacons heard by range and by synthetic aperture sonar (C19 chapters 4 and 5)."""

from engine.registry import Algorithm, Family
from engine.slam import beamform_only, gaussian_range, range_only, sas_all_priors, sas_dynamic, sas_static
from engine.slam.mission import fly, outline
from engine.slam.run import Options

SLAM = Family(name="slam", title="Localization and mapping by sound", fly=fly, outline=outline)


def _solver(name: str, title: str, summary: str, source: str, run, **more) -> Algorithm:
    return Algorithm(
        name=name, title=title, family="slam", summary=summary, source=source, run=run, options=Options, **more
    )


REGISTERED = (
    SLAM,
    _solver(
        "range_only",
        "Range-only SLAM",
        "Ranges of several peaks; beliefs are rings, then two places, then one.",
        "Cheung 2019, Table 5.1",
        range_only.run,
    ),
    _solver(
        "gaussian_range",
        "Range-only, one mode",
        "The same ranges by least squares from one guess: what a Gaussian makes of an ambiguous problem.",
        "comparison",
        gaussian_range.run,
    ),
    _solver(
        "sas_all_priors",
        "SAS, all fixes",
        "Synthetic apertures on poses that all have a fix: mapping alone.",
        "Cheung 2019, Table 5.2",
        sas_all_priors.run,
        assumes=("a fix at every pose, which no vehicle under water has",),
    ),
    _solver(
        "sas_static",
        "SAS-SLAM, static",
        "Synthetic apertures, odometry and a few fixes; poses are points.",
        "Cheung 2019, Table 5.3",
        sas_static.run,
    ),
    _solver(
        "sas_dynamic",
        "SAS-SLAM, dynamic",
        "As static, with velocities in the poses.",
        "Cheung 2019, Table 5.4",
        sas_dynamic.run,
    ),
    _solver(
        "beamform_only",
        "Beamformer alone",
        "Every array on dead-reckoned poses, their densities multiplied: no SLAM.",
        "Cheung 2019, Fig. 5-17",
        beamform_only.run,
    ),
)
