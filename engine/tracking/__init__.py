"""Multi-sensor tracking of one target (RC: Rui and Chitre): one file per fusion rule."""

from engine.registry import Algorithm, Family
from engine.tracking.covariance_intersection import covariance_intersection
from engine.tracking.distributed_fusion import distributed_fusion
from engine.tracking.inverse_covariance_intersection import inverse_covariance_intersection
from engine.tracking.mission import by, fly, outline, run_centrally
from engine.tracking.naive_fusion import naive_fusion
from engine.tracking.state_vector_fusion import state_vector_fusion

TRACKING = Family(name="tracking", title="Multi-sensor tracking", fly=fly, outline=outline)


def _fuser(name: str, title: str, summary: str, source: str, run, **more) -> Algorithm:
    return Algorithm(name=name, title=title, family="tracking", summary=summary, source=source, run=run, **more)


REGISTERED = (
    TRACKING,
    _fuser(
        "single_sensor",
        "Single sensor (SF)",
        "Every node alone with its own sensor.",
        "Rui and Chitre, eq. 2",
        by(None),
    ),
    _fuser(
        "centralized_fusion",
        "Central filter (CF)",
        "All measurements in one Kalman filter: the benchmark.",
        "Rui and Chitre, eq. 3-4",
        run_centrally,
        centralized=True,
        assumes=("every measurement reaches one place at once",),
    ),
    _fuser(
        "naive_fusion",
        "Naive fusion (NF)",
        "Fuses estimates as if independent; what they share counts twice.",
        "Rui and Chitre, eq. 15",
        by(naive_fusion),
    ),
    _fuser(
        "distributed_fusion",
        "Optimal distributed fusion (DF)",
        "Weighted sum of the estimates, the one weight chosen for the smallest error volume.",
        "Rui and Chitre, eq. 6-8",
        by(distributed_fusion),
        assumes=("every node knows the others' models and who heard whom, to track the cross-covariances",),
    ),
    _fuser(
        "state_vector_fusion",
        "State vector fusion (SVF)",
        "Maximum likelihood from the estimates with their tracked cross-covariance.",
        "Bar-Shalom and Campo 1986; Rui and Chitre, eq. 9",
        by(state_vector_fusion),
        assumes=("every node knows the others' models and who heard whom, to track the cross-covariances",),
    ),
    _fuser(
        "covariance_intersection",
        "Covariance intersection (CI)",
        "Consistent whatever the correlation, at a price.",
        "Julier and Uhlmann 1997",
        by(covariance_intersection),
    ),
    _fuser(
        "inverse_covariance_intersection",
        "Inverse covariance intersection (ICI)",
        "Tighter than CI where what is shared is common information.",
        "Noack, Sijs, Reinhardt and Hanebeck 2017",
        by(inverse_covariance_intersection),
    ),
)
