/** Colours of drawings, from the style sheet, so that they follow dark mode. */

import { useEffect, useState } from "preact/hooks";

export interface Palette {
  readonly paper: string;
  readonly ink: string;
  readonly soft: string;
  readonly grid: string;
  readonly query: string;
  readonly map: string;
  readonly pair: string;
  readonly miss: string;
  readonly select: string;
}

const NAMES = ["paper", "ink", "soft", "grid", "query", "map", "pair", "miss", "select"] as const;

function read(): Palette {
  const style = getComputedStyle(document.documentElement);
  const entries = NAMES.map((name) => [name, style.getPropertyValue(`--draw-${name}`).trim()]);
  return Object.fromEntries(entries) as unknown as Palette;
}

/** The palette of the present theme. */
export function usePalette(): Palette {
  const [palette, setPalette] = useState(read);
  useEffect(() => {
    const changed = () => setPalette(read());
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", changed);
    const observer = new MutationObserver(changed);
    observer.observe(document.documentElement, { attributeFilter: ["data-theme"] });
    changed();
    return () => {
      dark.removeEventListener("change", changed);
      observer.disconnect();
    };
  }, []);
  return palette;
}
