/** How a file of trees is read, and cut into submaps: the fields of the form, and the refusals that name them. */

import { ProblemError } from "urquhart-client";

import { asSentence, count } from "../parts/text";

export type Options = Readonly<Record<string, string>>;
type Field = readonly [name: string, label: string, values?: readonly string[]];

const LENGTHS = ["m", "ft", "us-ft", "cm", "km"];
/** What most files need, in the order of the form. */
const FIELDS: readonly Field[] = [
  ["x", "Column of x or easting"],
  ["y", "Column of y or northing"],
  ["id", "Column of tree ids"],
  ["plot", "Column of plots"],
  ["crs", "Coordinate system, such as EPSG:25832"],
  ["project", "Convert to the projected system"],
  ["azimuth", "Column of azimuths"],
  ["distance", "Column of distances"],
  ["angle", "Unit of azimuths", ["deg", "gon", "rad"]],
  ["unit", "Unit of positions", LENGTHS],
  ["dbh", "Column of diameters"],
  ["dbh_unit", "Unit of diameters", ["cm", "mm", "m", "in"]],
  ["decimal", "Decimal mark", ["point", "comma"]],
  ["ignore", "Columns to ignore, with commas"],
  ["layer", "Layer or sheet"],
];
const FURTHER: readonly Field[] = [
  ["only", "Read only the plot"],
  ["centre_x", "Column of x of plot centres"],
  ["centre_y", "Column of y of plot centres"],
  ["declination", "Degrees to add to azimuths"],
  ["slope", "Column of slopes"],
  ["slope_unit", "Unit of slopes", ["deg", "gon", "rad", "percent"]],
  ["quadrat_size", "Side of quadrats in metres"],
  ["height", "Column of heights"],
  ["height_unit", "Unit of heights", LENGTHS],
  ["species", "Column of species"],
  ["status", "Column of alive or dead"],
  ["keep", "Values of it to read, with commas"],
];
const SKIP_BAD: Field = ["skip_bad", "Leave out rows that cannot be used"];
export const RADIUS = "Radius of submaps in metres";
export const SPACING = "Distance between submaps in metres";
const LABELS = new Map<string, string>(
  [...FIELDS, ...FURTHER, SKIP_BAD, ["radius", RADIUS] as const, ["spacing", SPACING] as const].map(([name, label]) => [name, label]),
);

/** A sentence of the service, with fields of this page in place of the options of its commands. */
export function inFields(sentence: string): string {
  return sentence.replace(/--([a-z][a-z-]*)/g, (option, name: string) => {
    const label = LABELS.get(name.replaceAll("-", "_"));
    return label === undefined ? option : `“${label}”`;
  });
}

function Input({ field: [name, label, values], options }: { readonly field: Field; readonly options: Options }) {
  return (
    <label>
      {label}
      {values ? (
        <select name={name} defaultValue={options[name] ?? ""}>
          <option value="">as it looks</option>
          {values.map((value) => (
            <option key={value} selected={options[name] === value}>
              {value}
            </option>
          ))}
        </select>
      ) : (
        <input name={name} defaultValue={options[name] ?? ""} autoComplete="off" />
      )}
    </label>
  );
}

export function OptionsForm(props: {
  readonly options: Options;
  readonly onOptions: (options: Options) => void;
  readonly open: boolean;
}) {
  const { options } = props;
  const send = (event: SubmitEvent) => {
    event.preventDefault();
    const given = [...new FormData(event.currentTarget as HTMLFormElement)].map(([name, value]) => [name, String(value).trim()]);
    props.onOptions(Object.fromEntries(given.filter(([, value]) => value !== "")) as Record<string, string>);
  };
  return (
    <details class="panel" open={props.open}>
      <summary>How to read it</summary>
      <form onSubmit={send}>
        <div class="options">
          {FIELDS.map((field) => (
            <Input key={field[0]} field={field} options={options} />
          ))}
        </div>
        <details open={FURTHER.some(([name]) => name in options)}>
          <summary>More</summary>
          <div class="options">
            {FURTHER.map((field) => (
              <Input key={field[0]} field={field} options={options} />
            ))}
          </div>
        </details>
        <p class="actions start">
          <label class="check">
            <input type="checkbox" name={SKIP_BAD[0]} value="true" defaultChecked={SKIP_BAD[0] in options} />
            {SKIP_BAD[1]}
          </label>
          <button type="submit">Read it again</button>
        </p>
      </form>
    </details>
  );
}

/** Of a file, with the line or row, counted as the file does. */
interface Fault {
  readonly detail: string;
  readonly line?: number;
}

const MOST_ROWS = 200;

/** Why a file was refused, and all of its rows at fault. */
export function Refused({ error }: { readonly error: ProblemError }) {
  const rows: readonly Fault[] = error.problem.errors ?? [];
  const said = rows.length > 0 ? error.message.replace(/ \(\d+ more bad rows: [^)]*\)$/, "") : error.message;
  return (
    <section class="panel" role="alert">
      <h2>The file cannot be read</h2>
      <p class="note bad">{asSentence(inFields(said))}</p>
      {rows.length > 1 && (
        <div class="scroll rows" tabIndex={0} role="region" aria-label="Table of rows at fault">
          <table>
            <thead>
              <tr>
                <th scope="col" class="number">Row</th>
                <th scope="col">Why</th>
              </tr>
            </thead>
            <tbody>
              {rows.slice(0, MOST_ROWS).map((row, index) => (
                <tr key={index}>
                  <td class="number">{row.line ?? ""}</td>
                  <td>{inFields(row.detail)}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
      {rows.length > MOST_ROWS && (
        <p class="meta">
          These are the first {MOST_ROWS} of {count(rows.length)}.
        </p>
      )}
    </section>
  );
}
