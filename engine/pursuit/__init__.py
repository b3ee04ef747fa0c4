"""Acoustic pursuit of a target (C19 chapter 3: Cheung): one file per way to share what was heard."""

from engine.pursuit import centralized, decentralized
from engine.pursuit.listening import FilterChoice, run_filter, run_multilateration
from engine.pursuit.mission import fly, outline
from engine.pursuit.options import PursuitOptions
from engine.registry import Algorithm, Family

REGISTERED = (
    Family(name="pursuit", title="Acoustic pursuit", fly=fly, outline=outline),
    Algorithm(
        name="decentralized_pursuit",
        title="Decentralized pursuit",
        family="pursuit",
        summary="Every vehicle estimates from what it has heard so far, and steers by that at once.",
        source="Cheung 2019, chapter 3",
        run=decentralized.run,
        assumes=("vehicles know where they are and share a clock with each other, not with the target",),
        options=PursuitOptions,
    ),
    Algorithm(
        name="full_information_pursuit",
        title="Full information only",
        family="pursuit",
        summary="Decentralized, but nobody moves before all arrivals of a cycle are known.",
        source="Cheung 2019, chapter 3, without partial updates",
        run=decentralized.run_full_only,
        assumes=("vehicles know where they are and share a clock with each other, not with the target",),
        options=PursuitOptions,
    ),
    Algorithm(
        name="centralized_pursuit",
        title="Centralized pursuit",
        family="pursuit",
        summary="A shore station estimates, and sends waypoints in a slot of its own.",
        source="Cheung 2019, Fig. 3-4",
        run=centralized.run,
        assumes=("a shore station in reach of every vehicle", "one more slot in every cycle"),
        options=PursuitOptions,
    ),
    Algorithm(
        name="multilateration",
        title="Multilateration",
        family="pursuit",
        summary="Every ping by itself: least squares over the differences of its arrivals.",
        source="Cheung 2019, section 3.1; Levenberg and Marquardt",
        run=run_multilateration,
        centralized=True,
        assumes=("every arrival reaches one place at once", "moving receivers keep perfect formation"),
    ),
    Algorithm(
        name="tdoa_filter",
        title="TDOA filter",
        family="pursuit",
        summary="The sigma-point filter over all pings, with no channel in between.",
        source="Cheung 2019, eq. 3.2-3.19",
        run=run_filter,
        centralized=True,
        assumes=("every arrival reaches one place at once", "moving receivers keep perfect formation"),
        options=FilterChoice,
    ),
)
