"""The acoustic network of a navigation scenario: who speaks when, who hears whom, and what gets lost."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from engine.scenario.models import Fraction, Interval, NotNegative, Positive, Table


class LinkRate(Table):
    """A loss rate of one directed link."""

    sender: str = Field(description="name of the vehicle that sends")
    receiver: str = Field(description="name of the vehicle that listens")
    rate: Fraction = Field(description="fraction of packets lost")


class FixedLoss(Table):
    """Every packet is lost with the same probability, but for the links named."""

    kind: Literal["fixed"]
    rate: Fraction = Field(description="fraction of packets lost")
    links: list[LinkRate] = Field([], max_length=4096, description="directed links with a rate of their own")

    def of(self, sender: str, receiver: str) -> float:
        """The rate of one directed link."""
        own = [entry.rate for entry in self.links if (entry.sender, entry.receiver) == (sender, receiver)]
        return own[0] if own else self.rate


class RangeLoss(Table):
    """Loss grows with range along a logistic curve."""

    kind: Literal["range"]
    half_range_m: Positive = Field(description="range at which half of what is not lost anyway gets through, m")
    width_m: Positive = Field(description="how gradual the curve is, m: 12 % and 88 % lie two widths either side")
    floor: Fraction = Field(0.0, description="fraction lost even at close range")


class SnrLoss(Table):
    """Loss by signal-to-noise ratio: source level less spreading, absorption and noise, through a logistic curve."""

    kind: Literal["snr"]
    source_level_db: Annotated[float, Field(ge=0, le=300)] = Field(185.0, description="dB re 1 uPa at 1 m")
    noise_level_db: Annotated[float, Field(ge=0, le=300)] = Field(120.0, description="in the modem's band, dB re 1 uPa")
    spreading: Annotated[float, Field(ge=0, le=40)] = Field(
        15.0, description="dB per decade of range: 20 spherical, 10 cylindrical"
    )
    absorption_db_per_km: Annotated[float, Field(ge=0, le=1000)] = Field(4.0, description="dB per kilometre")
    half_snr_db: Annotated[float, Field(ge=-100, le=100)] = Field(
        10.0, description="SNR at which half gets through, dB"
    )
    width_db: Positive = Field(2.0, description="how gradual the curve is, dB")


class BurstyLoss(Table):
    """Gilbert-Elliott: each directed link turns between a good and a bad state, staying for random times."""

    kind: Literal["bursty"]
    mean_good_s: Positive = Field(description="mean length of a good spell, s")
    mean_bad_s: Positive = Field(description="mean length of a bad spell, s")
    good_rate: Fraction = Field(0.0, description="fraction lost in a good spell")
    bad_rate: Fraction = Field(1.0, description="fraction lost in a bad spell")


class Heard(Table):
    """What one receiver heard of one sender's broadcasts, in order."""

    sender: str = Field(description="name of the vehicle that sends")
    receiver: str = Field(description="name of the vehicle that listens")
    heard: list[bool] = Field(max_length=100_000, description="for each broadcast in turn; beyond the list all is lost")


class RecordedLoss(Table):
    """An explicit list of what was heard; a pair without an entry loses nothing."""

    kind: Literal["recorded"]
    links: list[Heard] = Field(max_length=10_000, description="one entry for each pair that loses anything")


def _which(value: Any) -> str:
    if isinstance(value, dict):
        return str(value.get("kind"))
    return "number" if not isinstance(value, Table) else value.kind  # type: ignore[attr-defined]


LossModel = FixedLoss | RangeLoss | SnrLoss | BurstyLoss | RecordedLoss
Loss = Annotated[
    Annotated[Fraction, Tag("number")]
    | Annotated[FixedLoss, Tag("fixed")]
    | Annotated[RangeLoss, Tag("range")]
    | Annotated[SnrLoss, Tag("snr")]
    | Annotated[BurstyLoss, Tag("bursty")]
    | Annotated[RecordedLoss, Tag("recorded")],
    Discriminator(_which),
]


class Slot(Table):
    """A time in the cycle at which a vehicle broadcasts."""

    vehicle: str = Field(description="name of the vehicle that sends")
    at_s: NotNegative = Field(description="time within the cycle, s")


class Tdma(Table):
    """Time-division schedule, repeated from the start of the mission to its end."""

    cycle_s: Annotated[float, Field(gt=0, le=1e6)] = Field(description="length of the cycle, s")
    slots: list[Slot] = Field(min_length=1, max_length=1000, description="who broadcasts when")
    packet_s: NotNegative = Field(1.0, description="length of a packet, s: who is sending that long hears nothing")


class Network(Table):
    """Who hears whom, and how well."""

    sound_speed_mps: Annotated[float, Field(ge=100, le=10_000)] = Field(
        1500.0, description="assumed to turn travel times into ranges, m/s"
    )
    sound_speed_sigma_mps: Annotated[float, Field(ge=0, le=1000)] = Field(
        0.0, description="how far the true one may be off, m/s; where positive, estimators estimate it"
    )
    gate_sigma: Annotated[float, Field(gt=0, le=1000)] | None = Field(
        None, description="refuse a range that is off by more than so many standard deviations"
    )
    links: Literal["all"] | list[Annotated[list[str], Field(min_length=2, max_length=2)]] = Field(
        "all", description='directed pairs ["from", "to"] that may hear, or "all"'
    )
    loss: Loss = Field(0.0, description="fraction of packets lost, or a loss model")
    silences: list[Interval] = Field([], max_length=1000, description="stretches in which nobody hears anything")
    capacity_bps: Positive | None = Field(
        None, description="what the channel carries, bit/s; a run that needs more on average is marked"
    )
    tdma: Tdma | None = Field(None, description="who broadcasts when; without it nobody does")

    @property
    def loss_model(self) -> LossModel:
        """The loss as a model, also where the file has a plain number."""
        return FixedLoss(kind="fixed", rate=self.loss, links=[]) if isinstance(self.loss, float | int) else self.loss
