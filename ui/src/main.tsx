/** The console: starts it, and shows the page that the address names. */

import { render } from "preact";

import { App } from "./app";

render(<App />, document.getElementById("app")!);
