"""The job that runs, as the page shows it."""

import math
import time
from dataclasses import dataclass, field

LEAST_SPENT_S, LEAST_SHARE = 3.0, 0.05  # before it is said how long a job will take


@dataclass(frozen=True)
class Job:
    """The job that runs."""

    task: str
    stage: str = "starting"
    share: float = 0.0
    is_cancelled: bool = False
    begun: float = field(default_factory=time.monotonic)

    def time_left(self, now: float) -> str:
        """How long it will still take if it goes on as until now; "" while that is unknown."""
        spent = now - self.begun
        if self.is_cancelled or spent < LEAST_SPENT_S or not LEAST_SHARE < self.share < 1:
            return ""
        seconds = spent * (1 - self.share) / self.share
        return f"about {10 * math.ceil(seconds / 10)} s left"
