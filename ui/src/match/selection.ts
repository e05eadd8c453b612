/** The selected tree, in the address, so that a link shows it: `tree=query-17`. */

import { useMemo } from "preact/hooks";

import { setQuery, useAddress } from "../parts/router";
import type { Tree } from "./overlay";

export function useSelected(): [Tree | null, (tree: Tree | null) => void] {
  const text = useAddress().query.get("tree");
  const tree = useMemo(() => {
    const read = /^(query|submap)-([0-9]{1,6})$/.exec(text ?? "");
    return read ? { side: read[1] as Tree["side"], at: Number(read[2]) } : null;
  }, [text]);
  const select = (next: Tree | null) => setQuery({ tree: next && `${next.side}-${next.at}` });
  return [tree, select];
}
