"""The acoustic channel of a simulated mission: who broadcasts when, who may hear it, when it arrives, what is lost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine.mission.log import AcousticLog
from engine.mission.streams import normals, uniforms
from engine.mission.vehicle import Voyage, within
from engine.scenario.navigation import NavigationScenario
from engine.scenario.network import BurstyLoss, FixedLoss, LossModel, Network, RangeLoss, RecordedLoss, SnrLoss

_TOL_S = 1e-12


def sound(scenario: NavigationScenario, voyages: Sequence[Voyage], trials: Sequence[int]) -> AcousticLog:
    """What every modem heard, and what it could have heard, of the scheduled broadcasts.

    A modem at the surface is silent and deaf; one that is sending hears nothing that arrives meanwhile. A reception
    that can take place in no trial is not in the log.
    """
    network, duration = scenario.network, scenario.duration_s or 0.0
    sender, tol = schedule(scenario, voyages)
    packet_s = network.tdma.packet_s if network.tdma is not None else 0.0
    linked = links(scenario)
    true_speed = sound_speeds(network, scenario.seed, trials)

    columns: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
    for r, voyage in enumerate(voyages):
        modem = voyage.vehicle.sensors.modem
        if modem is None:
            continue
        heard_of = np.flatnonzero(linked[sender, r])
        launched = np.empty((len(heard_of), 3))
        for s, other in enumerate(voyages):
            mine = sender[heard_of] == s
            launched[mine] = other.position(tol[heard_of[mine]])
        delay = light_time(voyage, launched, tol[heard_of], network.sound_speed_mps)
        toa = tol[heard_of] + delay
        own = tol[sender == r]
        possible = (toa <= duration) & ~voyage.surfaced(toa) & ~_overlaps(toa, own, packet_s)
        b, launched, toa, delay = heard_of[possible], launched[possible], toa[possible], delay[possible]

        travel = delay[None]
        if network.sound_speed_sigma_mps > 0:
            travel = light_time(voyage, launched, tol[b], true_speed[:, None])
        name = voyage.vehicle.name
        noise = normals(scenario.seed, trials, name, "ranging", (len(tol), 2))[:, b]
        chance = uniforms(scenario.seed, trials, name, "ranging chances", (len(tol), 3))[:, b]
        error = modem.range_sigma_m * noise[..., 0]
        gross = chance[..., 1] < modem.outlier_rate
        error += np.where(gross, modem.outlier_sigma_m * np.abs(noise[..., 1]), 0.0)
        distance = delay * network.sound_speed_mps
        got = np.empty((len(trials), len(b)), dtype=bool)
        for s in range(len(voyages)):
            mine = sender[b] == s
            if mine.any():
                turn = np.cumsum(sender == s)[b[mine]] - 1
                pair = (voyages[s].vehicle.name, name)
                got[:, mine] = heard(network.loss_model, pair, turn, tol[b[mine]], distance[mine], chance[:, mine])
        got[:, within(network.silences, toa)] = False
        measured = np.where(got, travel + error / network.sound_speed_mps, np.nan)
        columns.append((b, np.full(len(b), r), toa, measured))

    if not columns:
        none = np.empty(0, dtype=int)
        return AcousticLog(sender, tol, none, none, np.empty(0), np.empty((len(trials), 0)))
    broadcast, receiver, toa = (np.concatenate([c[i] for c in columns]) for i in range(3))
    travel_time = np.concatenate([c[3] for c in columns], axis=1)
    order = np.lexsort((receiver, toa))
    return AcousticLog(sender, tol, broadcast[order], receiver[order], toa[order], travel_time[:, order])


def schedule(scenario: NavigationScenario, voyages: Sequence[Voyage]) -> tuple[np.ndarray, np.ndarray]:
    """Sender (B,) and time of launch (B,) of all broadcasts, in order; none while the sender is at the surface."""
    tdma = scenario.network.tdma
    if tdma is None or scenario.duration_s is None:
        return np.empty(0, dtype=int), np.empty(0)
    index = {name: i for i, name in enumerate(scenario.names)}
    cycles = np.arange(int(np.ceil(scenario.duration_s / tdma.cycle_s)))
    tol = (cycles[:, None] * tdma.cycle_s + np.array([slot.at_s for slot in tdma.slots])).ravel()
    sender = np.tile([index[slot.vehicle] for slot in tdma.slots], len(cycles))
    order = np.lexsort((sender, tol))
    tol, sender = tol[order], sender[order]
    sends = tol < scenario.duration_s
    for i, voyage in enumerate(voyages):
        mine = sender == i
        sends[mine] &= ~voyage.surfaced(tol[mine])
    return sender[sends], tol[sends]


def links(scenario: NavigationScenario) -> np.ndarray:
    """Who may hear whom: (senders, receivers) flags."""
    n = len(scenario.vehicles)
    pairs = scenario.network.links
    if pairs == "all":
        return ~np.eye(n, dtype=bool)
    flags = np.zeros((n, n), dtype=bool)
    index = {name: i for i, name in enumerate(scenario.names)}
    for sender, receiver in pairs:
        flags[index[sender], index[receiver]] = True
    return flags


def sound_speeds(network: Network, seed: int, trials: Sequence[int]) -> np.ndarray:
    """The true sound speed of every trial (trials,), m/s; never below a tenth of the assumed one."""
    drawn = normals(seed, trials, "", "sound speed", (1,))[:, 0]
    speed = network.sound_speed_mps + network.sound_speed_sigma_mps * drawn
    return np.maximum(speed, 0.1 * network.sound_speed_mps)


def light_time(voyage: Voyage, launched: np.ndarray, tol: np.ndarray, speed: np.ndarray | float) -> np.ndarray:
    """Travel time (..., R) from launched positions (R, 3) at tol (R,) to where the receiver is on arrival.

    Solves |receiver(tol + tau) - launched| = speed tau by iteration, which contracts by receiver speed over sound
    speed each time. `speed` is a number or (trials, 1).
    """
    delay = np.zeros(np.broadcast_shapes(np.shape(speed), tol.shape))
    for _ in range(50):
        before = delay
        delay = np.linalg.norm(voyage.position(tol + delay) - launched, axis=-1) / speed
        if delay.size == 0 or np.max(np.abs(delay - before)) < _TOL_S:
            break
    return delay


def _overlaps(arrival: np.ndarray, launches: np.ndarray, packet_s: float) -> np.ndarray:
    """Whether a packet that begins to arrive then (R,) meets one of the receiver's own, each packet_s long."""
    if not launches.size:
        return np.zeros(arrival.shape, dtype=bool)
    after = np.searchsorted(launches, arrival)
    following = launches[np.minimum(after, len(launches) - 1)]
    preceding = launches[np.maximum(after - 1, 0)]
    return (np.abs(following - arrival) < packet_s) | (np.abs(arrival - preceding) < packet_s)


def heard(
    loss: LossModel, pair: tuple[str, str], turn: np.ndarray, tol: np.ndarray, distance: np.ndarray, chance: np.ndarray
) -> np.ndarray:
    """Which broadcasts from one sender got through to one receiver: (trials, R) flags.

    pair is (sender, receiver); turn (R,) numbers the sender's broadcasts; distance (R,) m; chance (trials, R, 3)
    are uniform numbers, the first for the loss and the third for the spells of a bursty channel.
    """
    draw = chance[..., 0]
    match loss:
        case FixedLoss():
            return draw >= loss.of(*pair)
        case RangeLoss():
            through = (1 - loss.floor) * _logistic((loss.half_range_m - distance) / loss.width_m)
            return draw < through
        case SnrLoss():
            return draw < _logistic((snr_db(loss, distance) - loss.half_snr_db) / loss.width_db)
        case BurstyLoss():
            rate = np.where(bad_spells(loss, tol, chance[..., 2]), loss.bad_rate, loss.good_rate)
            return draw >= rate
        case RecordedLoss():
            entry = next((e for e in loss.links if (e.sender, e.receiver) == pair), None)
            if entry is None:
                return np.ones(draw.shape, dtype=bool)
            listed = np.array([*entry.heard, False])
            return np.broadcast_to(listed[np.minimum(turn, len(entry.heard))], draw.shape)


def snr_db(loss: SnrLoss, distance: np.ndarray) -> np.ndarray:
    """Passive sonar equation: SL - k log10 r - alpha r - NL, dB (Urick 1983), r at least 1 m."""
    r = np.maximum(distance, 1.0)
    return (
        loss.source_level_db - loss.spreading * np.log10(r) - loss.absorption_db_per_km * r / 1e3 - loss.noise_level_db
    )


def bad_spells(loss: BurstyLoss, tol: np.ndarray, chance: np.ndarray) -> np.ndarray:
    """Whether the channel is in its bad state at times tol (R,): (trials, R), a two-state Markov process in time."""
    to_bad, to_good = 1 / loss.mean_good_s, 1 / loss.mean_bad_s
    settled = to_bad / (to_bad + to_good)
    bad = np.empty(chance.shape, dtype=bool)
    memory = np.exp(-(to_bad + to_good) * np.diff(tol))
    for k in range(chance.shape[1]):
        was = 0.0 if k == 0 else memory[k - 1] * (bad[:, k - 1] - settled)
        bad[:, k] = chance[:, k] < settled + was
    return bad


def _logistic(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-np.clip(x, -500, 500)))
