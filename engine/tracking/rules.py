"""Names to fusion rules."""

from __future__ import annotations

from engine.tracking.covariance_intersection import covariance_intersection
from engine.tracking.distributed_fusion import distributed_fusion
from engine.tracking.inverse_covariance_intersection import inverse_covariance_intersection
from engine.tracking.naive_fusion import naive_fusion
from engine.tracking.recursion import Rule
from engine.tracking.state_vector_fusion import state_vector_fusion

RULES: dict[str, Rule] = {
    "naive_fusion": naive_fusion,
    "distributed_fusion": distributed_fusion,
    "state_vector_fusion": state_vector_fusion,
    "covariance_intersection": covariance_intersection,
    "inverse_covariance_intersection": inverse_covariance_intersection,
}
