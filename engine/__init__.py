"""The estimation engine: scenario -> mission -> log -> estimators -> tracks -> metrics and claims."""

__version__ = "0.1.0"
