#!/bin/sh
# Makes a snapshot, verifies it, and copies it with its manifest to BACKUP_TARGET (a target of rsync, such as
# backup@vault.example:urquhart). Ends with an error if any step fails, so that the timer reports it.
set -eu
: "${BACKUP_TARGET:?set BACKUP_TARGET to a target of rsync, such as backup@vault.example:urquhart}"
name="nightly-$(date -u +%Y%m%dT%H%M%SZ)"
urquhart snapshot create "$name"
urquhart snapshot verify "$name"
# The folder lies beside the database, whose path the settings tell.
folder="$(urquhart config --json | python3 -c '
import json, pathlib, sys
database = next(one["value"] for one in json.load(sys.stdin) if one["name"] == "database")
path = database.removeprefix("sqlite:///").partition("?")[0]
print(pathlib.Path(path).resolve().as_posix() + ".snapshots")')"
# The manifest last: a copy without one is not complete.
rsync --archive --partial "$folder/$name.db" "$BACKUP_TARGET/"
rsync --archive "$folder/$name.json" "$BACKUP_TARGET/"
echo "$name copied to $BACKUP_TARGET"
