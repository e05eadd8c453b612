/** Light, dark, or as the system says. */

import { useEffect, useState } from "preact/hooks";

const THEMES = ["auto", "light", "dark"] as const;
type Theme = (typeof THEMES)[number];
const NAMES: Record<Theme, string> = { auto: "Theme: as the system", light: "Theme: light", dark: "Theme: dark" };
const SIGNS: Record<Theme, string> = { auto: "◐", light: "☀", dark: "☾" };
const KEY = "urquhart-theme";

function stored(): Theme {
  const value = localStorage.getItem(KEY);
  return THEMES.find((theme) => theme === value) ?? "auto";
}

export function ThemeButton() {
  const [theme, setTheme] = useState(stored);
  useEffect(() => {
    localStorage.setItem(KEY, theme);
    document.documentElement.dataset.theme = theme;
  }, [theme]);
  const next = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length]!;
  return (
    <button type="button" class="quiet sign" onClick={() => setTheme(next)} aria-label={NAMES[theme]} title={NAMES[theme]}>
      {SIGNS[theme]}
    </button>
  );
}
