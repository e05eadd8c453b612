"""What servers need loaded before they are forked: modules and kernels, but no thread and no open file."""

import server.cli
import server.submaps.described_batches  # noqa: F401
import urquhart
from server.platform.thread_limits import pin_threads

pin_threads()
urquhart.warm_up(urquhart.Config())
