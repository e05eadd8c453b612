"""Describing lines of an import in a process that some of them are too much for."""

import os
import signal
import time
from typing import Any

from server.submaps import described_batches


def poisoned(task: Any) -> Any:
    """Describes lines, of which `poison` ends the process and `endless` never ends."""
    if any(b'"poison' in line for _, line in task.lines):
        os.kill(os.getpid(), signal.SIGKILL)
    if any(b'"endless' in line for _, line in task.lines):
        time.sleep(600)
    return described_batches._describe_there(task)
