"""Plain CSV files: what is read, and what is refused rather than guessed."""

from pathlib import Path

import pytest

from server.stem_maps.reader import StemMapError, read_stem_map

GRID = [(i % 5 * 4.5, i // 5 * 3.5) for i in range(25)]


def grid(header: str, row: str) -> str:
    """A table of 25 trees; `row` may name x, y and n."""
    return header + "\n" + "".join(row.format(x=x, y=y, n=n) + "\n" for n, (x, y) in enumerate(GRID, start=1))


READ = {
    "positions": grid("x,y", "{x},{y}"),
    "names in any order and case": grid("Y_M, X_m", "{y},{x}"),
    "tags and diameters": grid("tree_id,x,y,dbh_cm,height_m,species", "t{n},{x},{y},{n},12.5,oak"),
    "some not known": grid("tag,x,y,dbh_cm,height_m,species", "{n},{x},{y},,,"),
    "diameters in mm": grid("id,x,y,dbh_mm", "{n},{x},{y},{n}11"),
    "diameters in m": grid("id,x,y,dbh_m", "{n},{x},{y},0.3{n}"),
    "diameters in inches": grid("id,x,y,dbh_in", "{n},{x},{y},{n}"),
    "diameters without a unit": grid("tree,x,y,dbh", "{n},{x},{y},20.{n}"),
    "a mark in front": "\ufeff" + grid("x,y", "{x},{y}"),
    "comments above": "# plot 7\n\n" + grid("x,y", "{x},{y}"),
    "blank lines": grid("x,y", "{x},{y}\n"),
    "tags with a hash": grid("id,x,y", "#{n},{x},{y}"),
    "quoted": grid('"id","x","y"', '"{n}","{x}","{y}"'),
    "tabs": grid("x\ty", "{x}\t{y}"),
    "semicolons and decimal commas": "x;y\n" + "".join(f"{x};{y}\n".replace(".", ",") for x, y in GRID),
    "exponents": "x,y\n1e1,2\n3,4.5\n-5,.5\n",
    "one plot": grid("plot,x,y", "a,{x},{y}"),
    "columns that mean nothing": grid("note,x,y", "leaning,{x},{y}"),
    "no tree": "x,y\n",
}
REFUSED = {
    "two systems": "x_m,y_m,x,y\n1_000,2,3,4\n,5,448120.5,5411000.2\n7,8,9,10\n",
    "two x": "x,x_m,y\n1,2,3\n",
    "the same name twice": "x,y,y\n1,2,3\n",
    "x of one system, y of another": "x_m,y\n,2\n",
    "underscores": "x,y\n1_000,2\n3,4\n5,7\n",
    "not finite": "x,y\nnan,2\n",
    "infinite": "x,y\n1,inf\n",
    "no number": "x,y\n1,b\n",
    "no value": "x,y\n1,\n",
    "too large": "x,y\n1e9,2\n",
    "a field too few": "x,y\n1\n",
    "a field too many": "x,y\n1,2,3\n",
    "no columns": "a,b\n1,2\n",
    "empty": "",
    "an id twice": "id,x,y\na,1,2\na,30,4\n",
    "an id left out": "id,x,y\na,1,2\n,3,4\n",
    "a diameter of none": "x,y,dbh_cm\n1,2,0\n",
    "two diameters": "x,y,dbh,dbh_cm\n1,2,3,4\n",
    "millimetres without their unit": grid("x,y,dbh", "{x},{y},2{n:02}"),
    "metres without their unit": grid("x,y,dbh", "{x},{y},0.3{n}"),
    "decimal commas between commas": "x,y\n1,5,2,5\n",
    "one digit": "x,y\n" + "".join(f"{10 + n},{n % 10}\n" for n in range(25)),
    "two marks": "x;y\n1,5;2\n1.5;2\n",
    "plots on each other": grid("plot,x,y", "a,{x},{y}") + "".join(f"b,{x},{y}\n" for x, y in GRID),
    "centres of plots": "x,y\n" + "1,2\n" * 9 + "5,6\n" * 9,
    "an open quote": 'x,y\n1,"2\n',
    "a comment below": "x,y\n1,2\n# end\n",
    "feet without their unit": "x,y,dbh_cm\n" + "".join(f"{8 * x},{8 * y},12\n" for x, y in GRID),
    "millimetres": "x,y\n" + "".join(f"{x * 1000},{y * 1000}\n" for x, y in GRID),
    "kilometres": "x,y\n" + "".join(f"{x / 1000 + 448},{y / 1000 + 5411}\n" for x, y in GRID),
    "degrees": "x,y\n" + "".join(f"{8 + x / 1e5},{48 + y / 1e5}\n" for x, y in GRID),
    "a line": "x,y\n" + "".join(f"{x},7.5\n" for x, _ in GRID),
    "a line of many": "x,y\n" + "".join(f"{1.5 * n},7.5\n" for n in range(25)),
    "too coarse": "x,y\n" + "".join(f"{round(x / 9) * 9},{round(y)}\n" for x, y in GRID),
    "positions twice": "x,y,easting,northing\n1,2,448001,5411002\n",
    "longitude": "lon,lat\n7.1,50.1\n",
}


@pytest.mark.parametrize("name", READ)
def test_plain_files_are_read(tmp_path: Path, name: str) -> None:
    (tmp_path / "seen.csv").write_bytes(READ[name].encode())
    assert len(read_stem_map(tmp_path / "seen.csv", allow_empty=True)) in (0, 3, 25)


@pytest.mark.parametrize("name", REFUSED)
def test_what_would_be_a_guess_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    file = tmp_path / "seen.csv"
    file.write_bytes(REFUSED[name].encode())
    with pytest.raises(StemMapError) as refused:
        read_stem_map(file)
    assert str(refused.value).startswith(str(file))
    assert "\n" not in str(refused.value)
