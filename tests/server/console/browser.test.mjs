// The console in Chromium. `test_browser.py` starts the services, and says in a file where they are and what they hold.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { after, before, test } from "node:test";

import { chromium } from "playwright-core";

const told = JSON.parse(readFileSync(process.env.CONSOLE_TOLD, "utf8"));
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const { matched, no_match: missed, ambiguous } = told.answers;
const matchPage = (answer) => `/ui/collections/${answer.collection}/queries/${answer.id}`;
let browser;

before(async () => {
  browser = await chromium.launch({
    executablePath: told.chromium,
    args: ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing", "--no-sandbox"],
  });
});
after(() => browser?.close());

/** Runs with a page of its own. Fails on an error in its console, a dialog, or a request to another host. */
async function onPage(base, options, run) {
  const context = await browser.newContext({ baseURL: base, viewport: { width: 1120, height: 700 }, ...options });
  const page = await context.newPage();
  const errors = [];
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("dialog", (dialog) => errors.push(`dialog ${dialog.message()}`) && dialog.dismiss());
  page.on("console", (message) => {
    if (message.type() === "error" && !page.expectsFailures) errors.push(message.text());
  });
  page.on("request", (request) => {
    const url = new URL(request.url());
    if (url.protocol.startsWith("http") && url.origin !== base) errors.push(`request to ${url.origin}`);
  });
  try {
    page.setDefaultTimeout(60_000); // whatever else the machine does
    await run(page, context).catch(async (error) => {
      const shown = await page.locator("body").innerText({ timeout: 1000 }).catch(() => "nothing");
      throw new Error(`${error.message}\nat ${page.url()}, which shows: ${shown.slice(0, 600)}\n${errors.join("\n")}`, { cause: error });
    });
    assert.deepEqual(errors, []);
  } finally {
    await context.close();
  }
}

/** Fails on anything that axe-core finds. */
async function accessible(page) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
  assert.deepEqual(
    violations.map(({ id, nodes }) => [id, nodes.slice(0, 3).map(({ html }) => html)]),
    [],
  );
}

/** Waits until a number that `count` finds is at least `least`. */
async function until(count, least, what) {
  for (let attempt = 0; ; attempt++) {
    const found = await count();
    if (found >= least) return;
    assert.ok(attempt < 100, `${found} ${what}, not ${least}`);
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
}

/** The colour of the canvas at a place in pixels of the page. */
function colourAt(page, x, y) {
  return page.evaluate(
    ([atX, atY]) => {
      const canvas = document.querySelector("canvas");
      const ratio = canvas.width / canvas.clientWidth;
      return [...canvas.getContext("2d").getImageData(Math.round(atX * ratio), Math.round(atY * ratio), 1, 1).data];
    },
    [x, y],
  );
}

test("a match is drawn where its trees are, with the numbers of the API", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.goto(matchPage(matched));
    await page.getByRole("heading", { name: "Matched p1" }).waitFor();
    const [best] = matched.candidates;
    const details = page.getByRole("complementary", { name: "Details" });
    const text = await details.innerText();
    assert.ok(text.includes(best.evidence.toFixed(1)) && text.includes(best.log_odds.toFixed(1)));
    assert.ok(text.includes(`${best.transform.x.toFixed(3)} m`));
    assert.ok((await page.locator(".lead").innerText()).startsWith(`${best.inlier_count} of the 45 trees`));
    const match = await (await page.request.get(best.links.match)).json();
    const { x: tx, y: ty, yaw } = best.transform;
    const trees = match.query_landmarks.map(([x, y]) => [
      Math.cos(yaw) * x - Math.sin(yaw) * y + tx,
      Math.sin(yaw) * x + Math.cos(yaw) * y + ty,
    ]);
    const { width, height } = await page.locator("canvas").boundingBox();
    const [west, east] = [Math.min(...trees.map(([x]) => x)), Math.max(...trees.map(([x]) => x))];
    const [south, north] = [Math.min(...trees.map(([, y]) => y)), Math.max(...trees.map(([, y]) => y))];
    const scale = Math.min((width - 72) / (east - west), (height - 72) / (north - south));
    const orange = async () => {
      let found = 0;
      for (const [x, y] of trees.slice(0, 20)) {
        const [px, py] = [width / 2 + (x - (west + east) / 2) * scale, height / 2 - (y - (south + north) / 2) * scale];
        const [red, green, blue] = await colourAt(page, px, py);
        if (red > 180 && green < 140 && blue < 60) found++;
      }
      return found;
    };
    await until(orange, 18, "of 20 trees are drawn where they are");
    await accessible(page);
  });
});

test("script in ids and titles stays text", async () => {
  await onPage(told.open, {}, async (page) => {
    for (const path of ["/ui", "/ui/collections/plots", matchPage(matched)]) {
      await page.goto(path);
      await page.getByText(told.hostile).first().waitFor();
      assert.equal(await page.locator("img[src=x]").count(), 0);
    }
  });
});

test("rivals are tabs, with an address of their own, and the keyboard reaches everything", async () => {
  await onPage(told.open, {}, async (page) => {
    assert.equal(ambiguous.verdict, "ambiguous");
    await page.goto(matchPage(ambiguous));
    await page.getByRole("heading", { name: /^Ambiguous/ }).waitFor();
    await page.getByRole("heading", { name: "What would make it a match" }).waitFor();
    await page.getByRole("tab", { selected: true }).focus();
    for (let step = 0; step < ambiguous.candidates.length; step++) await page.keyboard.press("ArrowRight");
    assert.match(page.url(), /show=rival-1/);
    const rival = page.getByRole("tab", { selected: true });
    assert.ok(await rival.evaluate((element) => element === document.activeElement));
    await page.getByRole("heading", { name: /^A rival/ }).waitFor();
    await page.reload();
    await page.getByRole("heading", { name: /^A rival/ }).waitFor();
    for (const mode of ["Blink", "Swipe"]) {
      const button = page.getByRole("button", { name: mode });
      await button.focus();
      await page.keyboard.press("Enter");
      assert.equal(await button.getAttribute("aria-pressed"), "true");
    }
    await page.getByRole("slider").focus();
    await page.keyboard.press("ArrowLeft");
    await accessible(page);
    const canvas = page.locator("canvas");
    const picture = () => canvas.evaluate((element) => element.toDataURL());
    const earlier = await picture();
    await canvas.focus();
    await page.keyboard.press("+");
    await page.waitForFunction((old) => document.querySelector("canvas").toDataURL() !== old, earlier);
  });
});

test("an answer without a match says why, and pictures are saved as files", async () => {
  await onPage(told.open, { acceptDownloads: true }, async (page) => {
    await page.goto(matchPage(missed));
    await page.getByRole("heading", { name: /^No match/ }).waitFor();
    await page.goto(matchPage(matched));
    for (const [name, begins] of [["Save PNG", "\x89PNG"], ["Save SVG", "<svg "]]) {
      const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name }).click()]);
      const saved = readFileSync(await download.path(), "latin1");
      assert.ok(saved.startsWith(begins), name);
      if (name === "Save SVG") assert.ok(saved.includes("Matched") && !saved.includes("<img"));
    }
  });
});

test("stored queries are listed, by verdict, and lead to their pages", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.goto("/ui/collections/plots");
    await page.getByRole("link", { name: "Queries" }).click();
    await page.getByRole("link", { name: `Query ${matched.id}` }).waitFor();
    await page.getByText("How sure the answers were").click();
    await page.getByText("1 matched").waitFor();
    await accessible(page);
    await page.getByLabel("Verdict").selectOption("matched");
    await page.getByRole("link", { name: `Query ${missed.id}` }).waitFor({ state: "detached" });
    await page.getByRole("link", { name: `Query ${matched.id}` }).click();
    await page.getByRole("heading", { name: "Matched p1" }).waitFor();
  });
});

test("a query that is not there, and a page that is not, say so", async () => {
  await onPage(told.open, {}, async (page) => {
    page.expectsFailures = true;
    await page.goto("/ui/collections/plots/queries/99");
    await page.getByRole("alert").getByText("stored query").waitFor();
    await page.goto("/ui/nowhere");
    await page.getByText("There is no such page").waitFor();
  });
});

test("collections are made and deleted, with a confirmation, by keyboard", async () => {
  await onPage(told.open, { colorScheme: "dark" }, async (page) => {
    await page.goto("/ui");
    await page.getByRole("link", { name: /^plots/ }).waitFor();
    await accessible(page);
    await page.getByRole("button", { name: "New collection" }).press("Enter");
    page.expectsFailures = true;
    await page.getByLabel("Id").fill("plots");
    await page.keyboard.press("Enter");
    await page.getByRole("alert").waitFor();
    page.expectsFailures = false;
    await page.getByLabel("Id").fill("made-here");
    await accessible(page);
    await page.keyboard.press("Enter");
    await page.getByRole("heading", { name: "made-here", level: 1 }).waitFor();
    await page.getByRole("heading", { name: "No submaps yet" }).waitFor();
    await page.getByRole("button", { name: "Delete …" }).press("Enter");
    const sure = page.getByRole("button", { name: "Delete it" });
    assert.ok(await sure.isDisabled());
    await page.getByLabel(/^To confirm/).fill("made-here");
    await page.keyboard.press("Enter");
    await page.getByRole("heading", { name: "Collections" }).waitFor();
    assert.equal(await page.getByRole("link", { name: /^made-here/ }).count(), 0);
    const ground = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    assert.equal(ground, "rgb(15, 21, 18)");
    await page.getByRole("button", { name: /^Theme/ }).click();
    await page.waitForFunction((dark) => getComputedStyle(document.body).backgroundColor !== dark, ground);
  });
});

test("a key opens a session with its scopes, a wrong one none, and an ended one says so", async () => {
  await onPage(told.closed, {}, async (page, context) => {
    await context.addCookies([{ name: "urquhart_session", value: told.ended, url: told.closed }]);
    await page.goto("/ui/collections/plots");
    await page.getByRole("alert").getByText("ended").waitFor();
    await accessible(page);
    page.expectsFailures = true;
    await page.getByLabel("API key").fill("urq_wrong");
    await page.keyboard.press("Enter");
    await page.getByRole("alert").getByText("Authorization must be").waitFor();
    page.expectsFailures = false;
    await page.getByLabel("API key").fill(told.reader);
    await page.keyboard.press("Enter");
    await page.getByRole("heading", { name: "plots", level: 1 }).waitFor();
    assert.equal(await page.getByRole("button", { name: "Delete …" }).count(), 0);
    await page.getByRole("link", { name: "Collections" }).first().click();
    await page.getByRole("link", { name: "plots" }).waitFor();
    assert.equal(await page.getByText("secret").count(), 0);
    assert.equal(await page.getByRole("button", { name: "New collection" }).count(), 0);
    assert.equal(await page.evaluate(() => document.cookie), "");
    // A session that ends meanwhile: the key is asked for, and the page goes on where it was.
    await page.goto("/ui/jobs");
    await page.getByRole("heading", { name: "No jobs yet" }).waitFor();
    page.expectsFailures = true;
    await context.clearCookies();
    await page.getByLabel("State").selectOption("failed");
    await page.getByLabel("API key").fill(told.reader);
    await page.keyboard.press("Enter");
    await page.getByRole("heading", { name: "No job is failed" }).waitFor();
    await page.getByRole("button", { name: "Sign out" }).click();
    await page.getByLabel("API key").waitFor();
  });
});

test("a service that is gone is said to be, and the page goes on when it is back", async () => {
  await onPage(told.open, {}, async (page, context) => {
    await page.goto("/ui");
    await page.getByRole("link", { name: /^plots/ }).waitFor();
    page.expectsFailures = true;
    await context.setOffline(true);
    await page.getByRole("link", { name: /^plots/ }).click();
    await page.getByText("The service cannot be reached").waitFor();
    await context.setOffline(false);
    await page.getByRole("heading", { name: "Submaps" }).waitFor();
    // A page that was shown before stays, and says so.
    await page.goto("/ui");
    await page.getByRole("link", { name: /^plots/ }).waitFor();
    await context.setOffline(true);
    await page.getByText("What is shown is what it said last").waitFor();
    assert.ok(await page.getByRole("link", { name: /^plots/ }).isVisible());
    await context.setOffline(false);
    await page.getByText("What is shown is what it said last").waitFor({ state: "detached" });
    // A page of many panels says so once, whether it was shown before or not.
    await context.setOffline(true);
    await page.getByRole("link", { name: "Operations" }).click();
    await page.getByRole("heading", { name: "The service cannot be reached" }).waitFor();
    assert.equal(await page.getByText("The service cannot be reached").count(), 1);
    await context.setOffline(false);
    await page.getByText("Verdicts since the start").waitFor();
    await context.setOffline(true);
    await page.getByText("What is shown is what it said last").waitFor();
    await page.waitForRequest(/metrics/);
    assert.equal(await page.getByText("The service cannot be reached").count(), 1);
    await context.setOffline(false);
  });
});

test("the map draws trees where they are, and finds submaps by id", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.goto("/ui/collections/plots/map");
    await page.getByText("120", { exact: true }).waitFor();
    await page.getByLabel("Find a submap").fill("p2");
    await page.keyboard.press("Enter");
    await page.getByRole("heading", { name: "p2" }).waitFor();
    await page.waitForURL(/scale=/);
    await accessible(page);
    // The view is in the address: the middle in metres of the map frame, and pixels for each metre.
    const [x, y, scale] = ["x", "y", "scale"].map((name) => Number(new URL(page.url()).searchParams.get(name)));
    const drawn = () => page.evaluate(
      ([places, viewX, viewY, pixels]) => {
        const canvas = document.querySelector("canvas.under");
        const gl = canvas.getContext("webgl2");
        const ratio = canvas.width / canvas.clientWidth;
        return places.filter(([placeX, placeY]) => {
          const colour = new Uint8Array(4);
          const left = canvas.width / 2 + (placeX - viewX) * pixels * ratio;
          const up = canvas.height / 2 + (placeY - viewY) * pixels * ratio;
          gl.readPixels(Math.floor(left), Math.floor(up), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, colour);
          return colour[3] > 200;
        }).length;
      },
      [told.p2, x, y, scale],
    );
    await until(drawn, told.p2.length * 0.95, "trees are drawn where they are");
    await page.reload();
    await page.getByRole("heading", { name: "p2" }).waitFor();
    await page.getByRole("button", { name: "Find it among the others" }).click();
    await page.getByRole("heading", { name: /^No match/ }).waitFor();
  });
});

test("a file is understood, looked up, and stored", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.goto("/ui/try?collection=plots");
    const rows = told.seen.map(([x, y], at) => `${at},${x},${y}`);
    const buffer = Buffer.from(["tag,x,y", ...rows].join("\n"));
    await page.locator("input[type=file]").setInputFiles({ name: "seen.csv", mimeType: "text/csv", buffer });
    await page.getByText("read tree_id from").or(page.getByText("Read tree_id from")).waitFor();
    await accessible(page);
    await page.getByRole("button", { name: `Find ${rows.length} trees` }).click();
    await page.getByRole("heading", { name: "Matched p1" }).waitFor();
    await page.goto("/ui/try?collection=plots");
    page.expectsFailures = true;
    await page.locator("input[type=file]").setInputFiles({ name: "odd.csv", mimeType: "text/csv", buffer: Buffer.from("a,b\n1,2\n") });
    await page.getByRole("alert").waitFor();
    await page.getByLabel("Column of x or easting").waitFor();
  });
});

test("a file is stored as a stand, as one submap or as overlapping ones", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.request.put("/v1/collections/sent", { data: {} });
    const side = [...Array(12).keys()];
    const plot = (step) => side.flatMap((x) => side.map((y) => `${12 * x + y},${step * x + (y % 3)},${step * y + ((x * y) % 2)}`));
    for (const [name, step, stored] of [["small", 3, "one"], ["wide", 10, "discs"]]) {
      page.expectsFailures = false;
      await page.goto("/ui/try?collection=sent");
      const buffer = Buffer.from(["tag,x,y", ...plot(step)].join("\n"));
      await page.locator("input[type=file]").setInputFiles({ name: `${name}.csv`, mimeType: "text/csv", buffer });
      await page.getByRole("button", { name: "Store in sent" }).waitFor();
      assert.equal(await page.getByLabel("Stored as").inputValue(), stored);
      if (stored === "discs") await page.getByLabel("Distance between submaps").fill("25");
      await accessible(page);
      await page.getByRole("button", { name: "Store in sent" }).click();
      const receipt = page.getByRole("status").filter({ hasText: `Stored as the stand ${name} in sent: 144 trees in ` });
      await receipt.waitFor();
      await accessible(page);
      page.expectsFailures = true;
      await page.getByRole("button", { name: "Store in sent" }).click();
      await page.getByText(`sent has a stand ${name} already: enter another name`).waitFor();
    }
    await page.goto("/ui/collections/sent");
    await page.getByRole("link", { name: /^wide/ }).first().waitFor();
    const { stands } = await (await page.request.get("/v1/collections/sent/stands")).json();
    const [small, wide] = stands;
    assert.equal(small.submaps, 1);
    assert.deepEqual([wide.radius, wide.spacing], [30, 25]);
    assert.ok(wide.submaps > 4);
    assert.equal(await page.getByRole("link", { name: /^wide/ }).count(), wide.submaps);
  });
});

test("a forester makes a collection without losing the file, stores it by a name of her own, and sees it on the map", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.goto("/ui/try");
    const rows = told.p2.map(([x, y], at) => `T${at},${x},${y}`);
    const buffer = Buffer.from(["Tree No,X,Y", ...rows].join("\n"));
    await page.locator("input[type=file]").setInputFiles({ name: "north.csv", mimeType: "text/csv", buffer });
    await page.getByRole("button", { name: "New collection …" }).click();
    await page.getByPlaceholder("plots-2026").fill("district");
    await page.getByRole("button", { name: "Make it" }).click();
    // The page behind the dialog takes no text until that is closed.
    await page.getByRole("button", { name: "Store in district" }).waitFor();
    await page.getByLabel("Name of the stand").fill("north-2026");
    await page.getByLabel("Stored as").selectOption("discs");
    await page.getByRole("button", { name: "Store in district" }).click();
    await page.getByText(`Stored as the stand north-2026 in district: ${rows.length} trees`).waitFor();
    await page.getByRole("link", { name: "See it on the map" }).click();
    await page.getByRole("heading", { name: "Map frame north-2026" }).waitFor();
    assert.equal((await page.request.delete("/v1/collections/district")).status(), 204);
  });
});

test("where a query was is marked on the map, with a way back", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.goto(matchPage(matched));
    await page.getByText("method robust, effort full").waitFor();
    await page.getByRole("link", { name: "See it on the map" }).click();
    await page.getByText("point (0, 0) of query").waitFor();
    await page.waitForURL(/scale=/);
    const { searchParams } = new URL(page.url());
    const [x, y, scale] = ["x", "y", "scale"].map((name) => Number(searchParams.get(name)));
    const { x: markX, y: markY } = matched.candidates[0].map_pose;
    const marked = () => page.evaluate(
      ([right, down]) => {
        const canvas = document.querySelector("canvas:not(.under)");
        const ratio = canvas.width / canvas.clientWidth;
        const [left, top] = [canvas.width / 2 + right * ratio, canvas.height / 2 + down * ratio];
        const [red, green, blue] = canvas.getContext("2d").getImageData(Math.round(left), Math.round(top), 1, 1).data;
        return red > 180 && green < 140 && blue < 60 ? 1 : 0;
      },
      [(markX - x) * scale, (y - markY) * scale],
    );
    await until(marked, 1, "dot where the query was");
    await accessible(page);
    await page.getByRole("link", { name: `query ${matched.id}` }).click();
    await page.getByRole("heading", { name: "Matched p1" }).waitFor();
  });
});

test("a query that did not match says what would have to be different", async () => {
  await onPage(told.open, {}, async (page) => {
    const asked = { xy: told.p2, store: true, explain: true };
    const ask = async (collection, more) =>
      (await page.request.post(`/v1/collections/${collection}/queries`, { data: { ...asked, ...more } })).json();
    await page.goto(matchPage(await ask("rows", { method: "paper" })));
    await page.getByText("Ask again with robust, the default").waitFor();
    assert.equal(await page.getByText("most likely not in").count(), 0);
    const missing = await ask("rows", {});
    assert.equal(missing.verdict, "no_match");
    await page.goto(matchPage(missing));
    const each = missing.candidates[0]?.evidence ?? 0;
    await page.getByText(each > 0 ? "more matching tree" : "most likely not in rows").first().waitFor();
  });
});

test("a file that is refused names fields of the page, and all rows at fault", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.goto("/ui/try?collection=plots");
    page.expectsFailures = true;
    const drop = (text) =>
      page.locator("input[type=file]").setInputFiles({ name: "odd.csv", mimeType: "text/csv", buffer: Buffer.from(text) });
    await drop("tag,lon,lat\n1,8.1,48.1\n2,8.1001,48.1\n3,8.1,48.1001\n");
    await page.getByRole("alert").getByText("“Convert to the projected system”").waitFor();
    assert.ok(!(await page.getByRole("alert").innerText()).includes("--"));
    const rows = [...Array(40).keys()].map((at) => `${at},${at % 5 === 0 ? "bad" : at},${(at * at) % 7}`);
    await drop(["tag,x,y", ...rows].join("\n"));
    await page.getByRole("region", { name: "Table of rows at fault" }).waitFor();
    assert.equal(await page.getByRole("cell", { name: "not a number" }).count(), 8);
    await accessible(page);
    await page.getByLabel("Leave out rows that cannot be used").check();
    await page.getByRole("button", { name: "Read it again" }).click();
    await page.getByText("32 rows read, 8 left out").or(page.getByText("40 rows read, 8 left out")).waitFor();
  });
});

test("a map shows constraints apart by their state, those of a submap, and what was observed until a moment", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.goto("/ui/collections/drive/map");
    const legend = page.getByRole("list", { name: "Legend" });
    await legend.getByText("1 constraint used by maps").waitFor();
    await legend.getByText("1 constraint stale").waitFor();
    const green = () =>
      page.evaluate(() => {
        const canvas = document.querySelector("canvas:not(.under)");
        const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        let found = 0;
        for (let at = 0; at < data.length; at += 4) {
          if (data[at + 3] > 150 && data[at + 1] > 130 && data[at] < 90 && data[at + 2] < 130) found++;
        }
        return found;
      });
    await until(green, 40, "pixels of the line");
    const slider = page.getByRole("slider", { name: /Observed until/ });
    await slider.focus();
    await page.keyboard.press("Home");
    await page.getByRole("status").filter({ hasText: "2026" }).waitFor();
    await page.waitForFunction(() => new URLSearchParams(location.search).has("until"));
    await until(async () => 40 - Math.min(await green(), 40), 40, "pixels of the line are gone");
    await page.keyboard.press("End");
    await until(green, 40, "pixels of the line");
    await page.getByLabel("Find a submap").fill("d2");
    await page.keyboard.press("Enter");
    await page.getByRole("heading", { name: "2 constraints" }).waitFor();
    await page.getByRole("cell", { name: "stale" }).waitFor();
    await accessible(page);
    await page.getByLabel("Constraints").uncheck();
    await legend.getByText("1 constraint used by maps").waitFor({ state: "detached" });
  });
});

test("jobs show their progress and what they refused, and operations how the service does", async () => {
  await onPage(told.open, {}, async (page) => {
    await page.goto("/ui/jobs");
    await page.locator(".badge.successful").waitFor();
    await accessible(page);
    await page.getByRole("link", { name: "import" }).click();
    await page.getByRole("heading", { name: "Lines that were refused" }).waitFor();
    await page.getByRole("cell", { name: /at least 3/ }).waitFor();
    const [lines] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: "1 refused line as a file" }).click()]);
    assert.match(readFileSync(await lines.path(), "utf8"), /"line":2/);
    await accessible(page);
    await page.getByRole("link", { name: "Operations" }).click();
    await page.getByText("Verdicts since the start").waitFor();
    await page.getByRole("button", { name: /^Show all/ }).click();
    await page.getByRole("cell", { name: "POST /v1/collections/{collection}/queries" }).first().waitFor();
    await page.getByText("There is none, so the service asks for none").waitFor();
    await page.getByText("Limits and versions").click();
    const { limits } = await (await page.request.get("/v1/limits")).json();
    await page.getByText(`${limits.body_bytes.toLocaleString("en")} (8.4 MB)`).first().waitFor();
    for (const title of ["Requests", "Verdicts a second", "Mean time of a query"]) {
      await page.getByRole("img", { name: new RegExp(`^${title}.* now: `) }).waitFor();
    }
    await accessible(page);
  });
});

test("a coregistration shows its files, the report first, and warns of plots that were not read", async () => {
  await onPage(told.open, { acceptDownloads: true }, async (page) => {
    const rows = told.seen.map(([x, y], at) => `P1,${at},${x},${y}`);
    const data = Buffer.from(["plot,tag,x,y", ...rows, "P2,1,bad,3"].join("\n"));
    const headers = { "Content-Type": "application/octet-stream" };
    const begun = await page.request.post("/v1/collections/plots/coregistrations?file=season.csv", { data, headers });
    assert.equal(begun.status(), 202, await begun.text());
    const { id } = await begun.json();
    await page.goto(`/ui/jobs/${id}`);
    await page.getByRole("heading", { name: "Files" }).waitFor();
    const report = page.getByRole("main").getByRole("listitem").first().getByRole("link");
    await report.waitFor();
    assert.equal(await report.innerText(), "report.html");
    const [download] = await Promise.all([page.waitForEvent("download"), report.click()]);
    assert.match(readFileSync(await download.path(), "utf8"), /<html/);
    await page.getByRole("cell", { name: "P2", exact: true }).waitFor();
    assert.equal(await page.locator(".warns").innerText(), "1");
    await accessible(page);
    await page.goto("/ui/jobs");
    await page.getByRole("link", { name: "coregistration" }).waitFor();
    assert.equal(await page.locator("td .warns").filter({ hasText: "1" }).count(), 2);
  });
});

test("an operator sees keys, which cannot be used, and makes a snapshot; a reader sees neither", async () => {
  await onPage(told.closed, {}, async (page) => {
    await page.goto("/ui/operations");
    await page.getByLabel("API key").fill(told.admin);
    await page.keyboard.press("Enter");
    await page.getByRole("cell", { name: "operator" }).waitFor();
    assert.ok(!(await page.content()).includes(told.admin.split("_")[2]));
    await page.getByRole("button", { name: "Make a snapshot" }).click();
    await page.getByText("2 collections").waitFor();
    await page.getByText("urquhart snapshot restore NAME").waitFor();
  });
  await onPage(told.closed, {}, async (page) => {
    await page.goto("/ui/operations");
    await page.getByLabel("API key").fill(told.reader);
    await page.keyboard.press("Enter");
    await page.getByText("Snapshots and keys need a key").waitFor();
    assert.equal((await page.request.get("/ui/keys")).status(), 403);
    await page.getByRole("link", { name: "Try it" }).click();
    const buffer = Buffer.from("tag,x,y\n1,0,0\n2,3,0\n3,0,4\n");
    await page.locator("input[type=file]").setInputFiles({ name: "seen.csv", mimeType: "text/csv", buffer });
    await page.getByRole("button", { name: "Find 3 trees" }).click();
    await page.getByText("There is no submap to look in").waitFor();
    assert.equal(await page.getByRole("button", { name: /^Store in/ }).count(), 0);
  });
});

test("a cancelled job says so in that word, and what stays; a failed one why, and which lines", async () => {
  await onPage(told.open, {}, async (page) => {
    const begun = [];
    // The first one keeps the others waiting.
    for (let at = 0; at < 3; at++) {
      const answer = await page.request.post("/v1/collections/plots/constraints", { data: {} });
      begun.push(await answer.json());
    }
    const { id } = begun.at(-1);
    await page.request.delete(`/v1/jobs/${id}`);
    await page.goto(`/ui/jobs/${id}`);
    await page.locator(".badge.dismissed, .badge.successful").waitFor();
    const { state } = await (await page.request.get(`/v1/jobs/${id}`)).json();
    if (state === "dismissed") {
      assert.equal(await page.locator(".badge").innerText(), "cancelled");
      await page.getByText("What it had stored until then stays").waitFor();
    }
    const data = '{"id":"b1","xy":[[0,0],[3,0],[0,4]]}\n{"id":"b2","xy":[[0,0]]}\n';
    const headers = { "Content-Type": "application/x-ndjson" };
    const failed = await (await page.request.post("/v1/collections/rows/imports?mode=all", { data, headers })).json();
    await page.goto(`/ui/jobs/${failed.id}`);
    await page.locator(".badge.failed").waitFor();
    await page.getByText("Nothing was stored: 1 line").waitFor();
    await page.getByRole("link", { name: "1 refused line as a file" }).waitFor();
    assert.equal(await page.getByText("Correct these lines, and send them again").count(), 0);
    await page.goto("/ui/jobs?state=dismissed");
    assert.equal(await page.getByLabel("State").inputValue(), "dismissed");
  });
});

test("a phone shows the whole of the navigation", async () => {
  await onPage(told.closed, { viewport: { width: 375, height: 740 }, isMobile: true, hasTouch: true }, async (page) => {
    await page.goto("/ui");
    await page.getByLabel("API key").fill(told.reader);
    await page.keyboard.press("Enter");
    const rail = page.getByRole("banner");
    await rail.getByRole("button", { name: "Sign out" }).waitFor();
    for (const one of [...(await rail.getByRole("button").all()), ...(await rail.getByRole("link").all())]) {
      const { x, width } = await one.boundingBox();
      assert.ok(x >= 0 && x + width <= 375, `${await one.innerText()} ends at ${x + width}`);
    }
  });
});

test("a phone shows it all without scrolling sideways", async () => {
  await onPage(told.open, { viewport: { width: 360, height: 740 }, isMobile: true, hasTouch: true }, async (page) => {
    for (const path of ["/ui", "/ui/collections/plots", "/ui/collections/plots/map", "/ui/jobs", "/ui/operations", matchPage(matched)]) {
      await page.goto(path);
      await page.waitForFunction(() => document.querySelector("main") && !document.querySelector(".loading"));
      const width = await page.evaluate(() => document.documentElement.scrollWidth);
      assert.ok(width <= 360, `${path} is ${width} pixels wide`);
    }
  });
});
