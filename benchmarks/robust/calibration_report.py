"""What the page says of the fitted confidence, written from `urquhart/calibration.json`."""

from benchmarks.experiments import Figures
from benchmarks.markdown import number, page, prose, table
from urquhart import Config


def calibration_section(figures: Figures) -> str:
    """Where the confidence comes from, by `urquhart/calibration.json`."""
    fit = figures["fit"]
    rows = []
    for name, lines, result in (
        ("in use", figures["in_use"], fit["result_of_those_before"]),
        ("latest fit", fit, fit["result"]),
    ):
        chance, rival = lines["chance"], lines["rival"]
        gate = Config().gate / chance["slope"] + chance["even"]
        numbers = [number(chance["slope"], 3), number(chance["even"]), number(rival["slope"], 3), number(rival["even"])]
        rows.append([name, *numbers, number(gate), str(result["accepted"]), str(result["wrong"])])
    return page(
        "## Where the confidence comes from",
        prose(
            f"""Two straight lines turn the log-odds against chance, and the lead over the best rival, into calibrated
            log-odds of being right. `{fit["command"]}` (seed {fit["seed"]}, last on {fit["date"]}) fits them
            by maximum likelihood to answers about the forests above, planted with another seed.
            `urquhart/calibration.json` holds the lines in use, the latest fit, and a digest of everything that the fit
            depends on; a test fails when one of these changes."""
        ),
        prose(figures.get("note", "")),
        table(
            [
                "lines",
                "chance: slope",
                "zero at",
                "rival: slope",
                "zero at",
                "log-odds at the gate",
                "accepted",
                "wrong",
            ],
            rows,
        ),
    )
