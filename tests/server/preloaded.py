"""What servers need loaded before they are forked: modules and kernels, but no thread and no open file."""

from importlib import import_module

import server.cli
import server.submaps.described_batches  # noqa: F401
import urquhart
from server.commands.loading import COMMANDS
from server.platform.thread_limits import pin_threads
from urquhart.warming import warm_up_paper

for entry in COMMANDS.values():
    import_module(entry.module)
pin_threads()
urquhart.warm_up(urquhart.Config())
warm_up_paper(urquhart.Config())
