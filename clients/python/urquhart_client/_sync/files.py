"""Calls about files: seasons of plots that a job places in a map, the files that it writes, and exports."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Unpack

from urquhart_client._protocol import file_requests, job_requests
from urquhart_client._protocol.archives import one_upload
from urquhart_client._protocol.exchange import Request
from urquhart_client._sync.jobs_and_snapshots import JobCalls
from urquhart_client.coregistrations import JobFile, PlotRow, SeasonOptions
from urquhart_client.job_models import Job, Progress
from urquhart_client.stem_maps import FileOptions


class FileCalls(JobCalls):
    """Files in and out."""

    def coregister(
        self,
        collection: str,
        *paths: str | Path,
        positions: str | Path | None = None,
        search: SeasonOptions | None = None,
        wait: bool = True,
        progress: Callable[[Progress], None] | None = None,
        idempotency_key: str | None = None,
        **options: Unpack[FileOptions],
    ) -> Job:
        """Place all plots of some files in the map of a collection, as `urquhart coregister` does, and wait for it.

        A plot that cannot be read or found is a row of `plot_rows`, and the others are placed. `download_job_files`
        gets the tables, layers, transforms, pictures and the report.

        Args:
            paths: files of one plot or many, in any format that the service reads, or folders of them.
            positions: a file that says where plots ought to be: plot, x, y. Needs `at_sigma` in `search`.
            search: how plots are searched.
            wait: until the job has ended, whatever its outcome; else it is returned as it was accepted.
            progress: called now and then.
            idempotency_key: the same for every attempt to upload this; made up when left out.
            options: what is known of the files beforehand.

        Raises:
            ValueError: there is no file, or two have one name.
            OSError: a file cannot be read.
        """
        where = None if positions is None else Path(positions)
        asked = {**options, **(search or {}), "positions": None if where is None else where.name}
        with one_upload([Path(path) for path in paths], where) as source:
            size = source.stat().st_size

            def sent(read: int) -> None:
                if progress is not None:
                    progress(Progress("sending", read, size))

            job = self._send(file_requests.post_coregistration(collection, source, asked, idempotency_key, sent))
        return self.wait_for_job(job.id, progress=progress) if wait else job

    def plot_rows(self, job_id: str) -> Iterator[PlotRow]:
        """What a coregistration found for each plot."""
        for line in self._lines(job_requests.get_results(job_id, "results")):
            yield PlotRow.model_validate_json(line)

    def job_files(self, job_id: str) -> list[JobFile]:
        """The files that a job wrote."""
        return self._send(file_requests.get_job_files(job_id))

    def download_job_files(self, job_id: str, folder: str | Path) -> list[Path]:
        """Download all files that a job wrote into a folder, which is created. A file that is there is replaced.

        Raises:
            OSError: a file cannot be written.
        """
        written = []
        for one in self._send(file_requests.get_job_files(job_id)):
            target = file_requests.inside(Path(folder), one.name)
            target.parent.mkdir(parents=True, exist_ok=True)
            self._save(file_requests.get_job_file(job_id, one.name), target)
            written.append(target)
        return written

    def export(
        self,
        collection: str,
        table: file_requests.ExportTable,
        path: str | Path,
        *,
        frame_id: str | None = None,
        session: str | None = None,
        bbox: tuple[float, float, float, float] | None = None,
        every: bool = False,
    ) -> Path:
        """Download a collection as a file for GIS, in the format that the suffix says. It replaces one that is there.

        Args:
            table: `landmarks` (trees), `submaps`, `matches` (stored queries), or `pairs` (of trees in these).
            path: ends in .csv, .geojson, .gpkg or .parquet.
            frame_id: only what is in this map frame; needed if map frames have several systems.
            session: only landmarks or submaps of this session.
            bbox: only submaps that overlap this box: min x, min y, max x, max y, metres, map frame.
            every: one row for each submap that has a tree, where overlapping submaps of a stand share it.

        Raises:
            ValueError: the suffix is of no format.
            OSError: the file cannot be written.
        """
        box = None if bbox is None else ",".join(map(repr, bbox))
        chosen = {"frame_id": frame_id, "session": session, "bbox": box, "every": every}
        target = Path(path)
        self._save(file_requests.get_export(collection, table, target, chosen), target)
        return target

    def _save(self, request: Request[str], target: Path) -> None:
        """Write the bytes of an answer to a file, which appears, or is replaced, when all have come."""
        part = target.with_name(f"{target.name}.part")
        try:
            with part.open("wb") as file:
                for piece in self._pieces(request):
                    file.write(piece)
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)
