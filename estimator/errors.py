"""Everything that can go wrong while a robot's body is estimated.

The tree::

    BodyschemaError
    └── EstimatorError
        ├── PluginError                      no implementation has a name, or several have it
        ├── RunDirectoryError                a run cannot be made, opened or continued
        ├── InteractionError                 the robot did not do its part; the run can go on later
        ├── ReadingsError (ValueError)       a hand-written table of readings is wrong
        ├── TruthError (ValueError)          a body that cannot serve as the truth
        ├── ProblemError (ValueError)        a problem file is wrong, or does not fit the robot
        ├── MorphologyError (ValueError)     a body that cannot exist
        ├── PhysicsError                     a simulation could not be run
        │   └── WorkerError                  worker processes died again and again
        ├── ClusterError                     a Dask cluster is missing, differs from us, or was lost
        └── SearchError
            ├── SearchOrderError (RuntimeError)   ask and tell out of turn
            └── SearchStateError (ValueError)     a saved state that fits no search
"""

from __future__ import annotations

from protocol.errors import BodyschemaError


class EstimatorError(BodyschemaError):
    """Base of every error that the estimator raises on purpose."""


class ProblemError(EstimatorError, ValueError):
    """A problem file is wrong, or does not fit the robot; the message has file, key and reason."""


class MorphologyError(EstimatorError, ValueError):
    """A body that cannot exist, such as one with a part on a later part or a negative length."""


class PhysicsError(EstimatorError):
    """A simulation could not be run, for want of an engine or for a wrong motor program."""


class WorkerError(PhysicsError):
    """Worker processes died again and again; most often for lack of memory."""


class ClusterError(EstimatorError):
    """A Dask cluster is missing, differs from this computer, or was lost."""


class SearchError(EstimatorError):
    """The search was used wrongly."""


class SearchOrderError(SearchError, RuntimeError):
    """``tell`` without ``ask``, or the other way round."""


class SearchStateError(SearchError, ValueError):
    """A saved state or a choice of operators that fits no search."""


class PluginError(EstimatorError):
    """No implementation has a name that was asked for, or more than one has it."""


class RunDirectoryError(EstimatorError):
    """A run cannot be made, opened or continued: it exists, or another process has it."""


class InteractionError(EstimatorError):
    """The robot did not do its part; the run is safe on disk and can be resumed."""


class ReadingsError(EstimatorError, ValueError):
    """A hand-written table of readings is wrong; the message has file, row, column and reason."""


class TruthError(EstimatorError, ValueError):
    """A body that cannot serve as the truth; the message has file, element and reason."""
