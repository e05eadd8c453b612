/** Entering a key. The browser keeps a session's cookie, not the key. */

import { useState } from "preact/hooks";

import { Title } from "../parts/common";
import { sentenceOf } from "../service/api";
import { beginSession, type Session } from "../service/session";

export function SignIn({ session, onDone }: { readonly session: Session; readonly onDone: () => void }) {
  const [key, setKey] = useState("");
  const [refusal, setRefusal] = useState(session.refusal ?? "");
  const [busy, setBusy] = useState(false);
  const send = async (event: Event) => {
    event.preventDefault();
    setBusy(true);
    try {
      await beginSession(key.trim());
      onDone();
    } catch (error) {
      setRefusal(sentenceOf(error));
      setBusy(false);
    }
  };
  return (
    <main class="sign-in">
      <Title>Sign in</Title>
      <form onSubmit={send}>
        <img src={new URL("../icon.svg", import.meta.url).href} alt="" width="56" height="56" />
        <h1>Urquhart</h1>
        <p>This service asks for an API key. The operator makes one with</p>
        <pre tabIndex={0}>urquhart keys create NAME --scope read --collections '*'</pre>
        <label for="key">API key</label>
        <input
          id="key"
          type="password"
          autoComplete="off"
          spellcheck={false}
          placeholder="urq_…"
          value={key}
          aria-describedby={refusal ? "refusal" : undefined}
          aria-invalid={refusal !== ""}
          onInput={(event) => setKey(event.currentTarget.value)}
        />
        {refusal && (
          <p id="refusal" class="note bad" role="alert">
            {refusal}
          </p>
        )}
        <button type="submit" class="primary" disabled={busy || key.trim() === ""}>
          Sign in
        </button>
        <small>The key is not stored in the browser. The session ends after twelve hours.</small>
      </form>
    </main>
  );
}
