"""What a worker process knows when it begins: importing this imports all that a shard may want."""

import logging
from importlib import import_module

from engine import registry
from server import commands, work

__all__ = ["commands", "work"]

import_module("engine.mission")
registry.families()
try:
    registry.algorithms()
except Exception as error:  # somebody's package; the server, which needs it too, tells where it is asked for
    logging.getLogger(__name__).warning("algorithms cannot be imported: %s", error)
