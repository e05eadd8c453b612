/** Numbers and times as people read them. */

const whole = new Intl.NumberFormat("en");

export const count = (value: number) => whole.format(value);

/** "1 tree", "2 trees". */
export const plural = (value: number, one: string, many = `${one}s`) => `${count(value)} ${value === 1 ? one : many}`;

/** A length: centimetres below a metre. */
export function metres(value: number): string {
  if (Math.abs(value) < 0.995) return `${(value * 100).toFixed(Math.abs(value) < 0.0995 ? 1 : 0)} cm`;
  return `${value.toFixed(Math.abs(value) < 100 ? 2 : 1)} m`;
}

export const degrees = (radians: number) => `${((radians * 180) / Math.PI).toFixed(2)}°`;

export const fixed = (value: number, digits = 1) => value.toFixed(digits);

/** A probability, never rounded up to certainty. */
export function percent(value: number): string {
  const shown = value * 100;
  if (shown > 99.995) return "over 99.99 %";
  if (shown > 0 && shown < 0.01) return "below 0.01 %";
  return `${shown.toFixed(shown > 99 || shown < 1 ? 2 : shown > 90 ? 1 : 0)} %`;
}

/** A share of something counted. */
export const share = (value: number) => `${Math.round(value * 100)} %`;

/** Milliseconds as a duration. */
export function duration(milliseconds: number): string {
  if (milliseconds < 1000) return `${milliseconds.toFixed(milliseconds < 10 ? 1 : 0)} ms`;
  const seconds = milliseconds / 1000;
  if (seconds < 90) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

const STEPS: readonly [number, string][] = [
  [60, "second"],
  [3600, "minute"],
  [86400, "hour"],
  [2592000, "day"],
];

/** How long ago, such as "3 minutes ago". */
export function ago(stamp: string, now = Date.now()): string {
  const seconds = Math.max(0, (now - Date.parse(stamp)) / 1000);
  if (seconds < 5) return "just now";
  let unit = 1;
  for (const [until, name] of STEPS) {
    if (seconds < until) return `${plural(Math.floor(seconds / unit), name)} ago`;
    unit = until;
  }
  return new Date(stamp).toLocaleDateString("en", { year: "numeric", month: "short", day: "numeric" });
}

/** A date and time of this place. */
export const moment = (stamp: string) =>
  new Date(stamp).toLocaleString("en", { dateStyle: "medium", timeStyle: "short" });

export function bytes(value: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let at = 0;
  let shown = value;
  while (shown >= 1000 && at < units.length - 1) {
    shown /= 1000;
    at++;
  }
  return `${shown.toFixed(at === 0 || shown >= 100 ? 0 : 1)} ${units[at]}`;
}

/** Why a collection has more trees than the file it came from. */
export const OVERLAP = "A tree that overlapping submaps share is counted in each of them.";

/** The first letter large, unless a file name begins the text; a full stop at the end. */
export function asSentence(text: string): string {
  const trimmed = text.trim();
  const named = /^\S+\.\w+:/.test(trimmed);
  return trimmed && (named ? trimmed[0]! : trimmed[0]!.toUpperCase()) + trimmed.slice(1) + (/[.!?]$/.test(trimmed) ? "" : ".");
}
