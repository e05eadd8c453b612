/** The service's metrics, read from the text that Prometheus reads. */

import { call } from "./api";

export interface Sample {
  readonly name: string;
  readonly labels: Readonly<Record<string, string>>;
  readonly value: number;
}

const LINE = /^([a-z_]+)(?:\{(.*)\})? ([^ ]+)$/;
const LABEL = /([a-z_]+)="((?:[^"\\]|\\.)*)"/g;

export async function readMetrics(signal?: AbortSignal): Promise<readonly Sample[]> {
  return samplesOf(await (await call("/metrics", signal ? { signal } : {})).text());
}

export function samplesOf(text: string): Sample[] {
  return text.split("\n").flatMap((line) => {
    const read = LINE.exec(line);
    if (read === null) return [];
    const labels = [...(read[2] ?? "").matchAll(LABEL)].map(([, name, value]) => [name!, unescaped(value!)]);
    return [{ name: read[1]!, labels: Object.fromEntries(labels) as Record<string, string>, value: Number(read[3]) }];
  });
}

const unescaped = (text: string) => text.replace(/\\(.)/g, (_, character) => (character === "n" ? "\n" : character));

/** The value of a metric with these labels; undefined if there is none. */
export function valueOf(samples: readonly Sample[], name: string, labels: Readonly<Record<string, string>> = {}) {
  const wanted = Object.entries(labels);
  return samples.find((one) => one.name === name && wanted.every(([label, value]) => one.labels[label] === value))?.value;
}
