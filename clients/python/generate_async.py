"""Generates the asynchronous client from the blocking one: `python clients/python/generate_async.py`.

A test compares the two.
"""

import ast
import re
from pathlib import Path

HERE = Path(__file__).parent / "urquhart_client"
_AWAITED = ("_send", "_exchange", "_hang_up", "get_job", "get_snapshot", "wait_for_job", "_save", "close")
_CALLS = (" http.close()", " http.request(", " stream.close()", " in self._pieces(")
_WORDS = {
    "_sync": "_async",
    "httpx.Client(": "httpx.AsyncClient(",
    "httpx.BaseTransport": "httpx.AsyncBaseTransport",
    " http.close()": " await http.aclose()",
    " stream.close()": " await stream.aclose()",
    " http.request(": " await http.request(",
    "with http.stream(": "async with http.stream(",
    "this_process": "this_loop",
    "blocking_body": "awaiting_body",
    "with self._streamed(": "async with self._streamed(",
    "contextmanager": "asynccontextmanager",
    "response.read()": "await response.aread()",
    "for line in response.iter_lines()": "async for line in response.aiter_lines()",
    "for piece in response.iter_bytes()": "async for piece in response.aiter_bytes()",
    "for line in self._lines(": "async for line in self._lines(",
    "for piece in self._pieces(": "async for piece in self._pieces(",
    "time.sleep(": "await asyncio.sleep(",
    "Iterator": "AsyncIterator",
    "__enter__": "__aenter__",
    "__exit__": "__aexit__",
    "The blocking client": "The awaiting client",
    "generates `_async` from it": "generates it from `_sync`",
}


def to_async(source: str) -> str:
    """The asynchronous form of a blocking module."""
    lines = source.splitlines(keepends=True)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and _waits(ast.get_source_segment(source, node) or "", node.name):
            lines[node.lineno - 1] = lines[node.lineno - 1].replace("def ", "async def ", 1)
    text = "".join(lines)
    for name in _AWAITED:
        text = re.sub(rf"(?<!def )\bself\.{name}\(", f"await self.{name}(", text)
    for word, other in _WORDS.items():
        text = text.replace(word, other)
    text = re.sub(r"\b(Connection|ServiceCalls|SubmapCalls|QueryCalls|JobCalls|FileCalls)\b", r"Async\1", text)
    if "asyncio.sleep" in text:
        text = text.replace("import time\n", "import asyncio\nimport time\n", 1)
    return text


def _waits(body: str, name: str) -> bool:
    if name == "__init__":
        return False
    if name in ("__enter__", "__exit__"):
        return True
    awaited = any(word in body for word in _CALLS) or any(f"self.{one}(" in body for one in _AWAITED)
    return (awaited and "lambda cursor" not in body) or "yield " in body


def generated() -> dict[Path, str]:
    """The expected files of the asynchronous client."""
    return {HERE / "_async" / path.name: to_async(path.read_text()) for path in sorted((HERE / "_sync").glob("*.py"))}


if __name__ == "__main__":
    (HERE / "_async").mkdir(exist_ok=True)
    for path, text in generated().items():
        path.write_text(text)
