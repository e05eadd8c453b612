/** The frame around all pages: navigation, session, theme. */

import { useCallback, useState } from "preact/hooks";

import { MapPage } from "./map/page";
import { MatchPage } from "./match/page";
import { CollectionPage } from "./pages/collection";
import { CollectionsPage } from "./pages/collections";
import { Message, Ready, Title } from "./parts/common";
import { Link, useAddress } from "./parts/router";
import { ThemeButton } from "./parts/theme";
import { SignedOut, useLoaded } from "./service/load";
import { endSession, readSession, type Session } from "./service/session";
import { JobPage, JobsPage } from "./pages/jobs";
import { OperationsPage } from "./pages/operations";
import { QueriesPage } from "./pages/queries";
import { SignIn } from "./pages/sign-in";
import { TryPage } from "./pages/try";

const PAGES = [
  ["collections", "Collections"],
  ["try", "Try it"],
  ["jobs", "Jobs"],
  ["operations", "Operations"],
] as const;

export function App() {
  const [turn, setTurn] = useState(0);
  const session = useLoaded(readSession, [turn]);
  const again = useCallback(() => setTurn((before) => before + 1), []);
  return (
    <SignedOut.Provider value={again}>
      <Ready of={session} what="the console">
        {(known) => (known.signed_in ? <Frame session={known} onChange={again} /> : <SignIn session={known} onDone={again} />)}
      </Ready>
    </SignedOut.Provider>
  );
}

function Frame({ session, onChange }: { readonly session: Session; readonly onChange: () => void }) {
  const { path } = useAddress();
  const [page = "collections"] = path;
  const signOut = () => void endSession().then(onChange);
  return (
    <div class="frame">
      <a class="skip" href="#page">
        Skip to the page
      </a>
      <header class="rail">
        <Link to="/" class="brand" aria-label="Urquhart, collections">
          <img src={new URL("./icon.svg", import.meta.url).href} alt="" width="28" height="28" />
          <span>Urquhart</span>
        </Link>
        <nav aria-label="Pages">
          {PAGES.map(([name, title]) => (
            <Link key={name} to={`/${name}`} aria-current={page === name ? "page" : undefined}>
              {title}
            </Link>
          ))}
        </nav>
        <div class="rail-end">
          <ThemeButton />
          <a href="/docs">API</a>
          {session.needs_key && (
            <button type="button" class="quiet" onClick={signOut} title={`Signed in with the key ${session.key}`}>
              Sign out
            </button>
          )}
          <small>{session.version}</small>
        </div>
      </header>
      <div id="page" tabIndex={-1}>
        <Page path={path} session={session} />
      </div>
    </div>
  );
}

function Page({ path, session }: { readonly path: readonly string[]; readonly session: Session }) {
  const [page = "collections", collection, part, id] = path;
  if (page === "collections" && path.length <= 1) return <CollectionsPage session={session} />;
  if (page === "collections" && collection !== undefined && path.length === 2) {
    return <CollectionPage key={collection} collection={collection} session={session} />;
  }
  if (page === "collections" && collection !== undefined && part === "queries" && path.length === 3) {
    return <QueriesPage key={collection} collection={collection} />;
  }
  if (page === "collections" && collection !== undefined && part === "map" && path.length === 3) {
    return <MapPage key={collection} collection={collection} />;
  }
  if (page === "collections" && collection !== undefined && part === "queries" && id !== undefined && path.length === 4) {
    return <MatchPage key={`${collection}/${id}`} collection={collection} query={id} />;
  }
  if (page === "try" && path.length === 1) return <TryPage session={session} />;
  if (page === "jobs" && path.length === 1) return <JobsPage />;
  if (page === "jobs" && path.length === 2) return <JobPage key={path[1]} id={path[1]!} session={session} />;
  if (page === "operations" && path.length === 1) return <OperationsPage session={session} />;
  return (
    <main>
      <Title>No such page</Title>
      <Message kind="error" title="There is no such page">
        <p>
          The address leads nowhere. <Link to="/collections">All collections</Link>
        </p>
      </Message>
    </main>
  );
}
