"""How often an address may try a token."""

from __future__ import annotations

import ipaddress
from collections import OrderedDict
from collections.abc import Callable

#: So many wrong tokens in a row are looked at, then one every so many seconds.
FREE, PAUSE_S = 10, 10.0
#: Addresses remembered; the one silent for longest is forgotten first.
MOST = 10_000


class Attempts:
    """Wrong tokens by address; each weighs less as time goes by."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._clear_at: OrderedDict[str, float] = OrderedDict()

    def wait_s(self, address: str) -> float:
        """Seconds until the address may try again; 0 when it may now."""
        ahead = self._clear_at.get(_network(address), 0.0) - self._clock()
        return max(0.0, ahead - (FREE - 1) * PAUSE_S)

    def failed(self, address: str) -> None:
        """Remember a wrong token."""
        network, now = _network(address), self._clock()
        self._clear_at[network] = max(self._clear_at.pop(network, now), now) + PAUSE_S
        if len(self._clear_at) > MOST:
            self._clear_at.popitem(last=False)


def _network(address: str) -> str:
    """What one attacker holds: an IPv4 address, or a /64 of IPv6."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if parsed.version == 4 or parsed.ipv4_mapped:
        return str(parsed)
    return str(ipaddress.ip_network((parsed, 64), strict=False))
