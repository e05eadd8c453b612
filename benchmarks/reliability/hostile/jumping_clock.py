"""The command line of the service with a clock that jumps: by as many seconds as a file says, read at every look.

    python -m benchmarks.reliability.hostile.jumping_clock CLOCK serve --port 0 ...

What measures durations (`time.monotonic`) is left alone, as it is when a machine's clock is set.
"""

import sys
import time
from datetime import datetime, timedelta, tzinfo
from pathlib import Path


class Clock:
    """Wall time, shifted.

    Args:
        path: file with the seconds to add.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._real, self._real_ns = time.time, time.time_ns

    def offset(self) -> float:
        """Seconds by which it is wrong."""
        return float(self._path.read_text(encoding="utf-8") or 0.0)

    def install(self) -> None:
        """Take the place of the clock, wherever the service looks at it; all its modules are imported by now."""
        clock = self

        class Jumped(datetime):
            @classmethod
            def now(cls, tz: tzinfo | None = None) -> datetime:  # type: ignore[override]
                return datetime.now(tz) + timedelta(seconds=clock.offset())

        time.time = lambda: self._real() + self.offset()
        time.time_ns = lambda: self._real_ns() + int(1e9 * self.offset())
        for name, module in list(sys.modules.items()):
            # Schemas do not look at the clock; they ask whether something is a datetime.
            looks = name.startswith("server.") and not name.startswith("server.schemas")
            if looks and getattr(module, "datetime", None) is datetime:
                vars(module)["datetime"] = Jumped


def main() -> None:
    """Set the clock up, then do what the rest of the arguments ask for."""
    from server.cli import main as command_line  # its modules must be there before the clock is

    Clock(Path(sys.argv.pop(1))).install()
    command_line()


if __name__ == "__main__":
    main()
