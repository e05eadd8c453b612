"""`urquhart warm`: compile the kernels before a service is started."""

import typer

from server.observability import kernel_progress
from server.parsing import strict_json
from urquhart._kernel import count_kernels


def warm() -> None:
    """Compile the kernels, or load them from the cache, so that no start has to wait for it.

    For images, and before a restart after an update. The cache is in NUMBA_CACHE_DIR if that is set. It is used again
    for the same sources and the same processor, also where it is copied to another machine. Set NUMBA_CPU_NAME=generic,
    here and for the service, if processors differ.
    """
    load_the_others = kernel_progress.warm_up(typer.echo)
    strict_json.warm_up()
    load_the_others()
    ready, count = count_kernels()
    typer.echo(f"kernels ready: {ready} of {count}; the others are for benchmarks only, or are parts of these")
