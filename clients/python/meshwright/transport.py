# SPDX-License-Identifier: Apache-2.0
"""HTTP with patience: a coordinator that is started anew costs time, not errors."""

from __future__ import annotations

import http.client
import json
import ssl
import time
import urllib.parse
from typing import Any, Callable, Dict, Iterator, Mapping, Optional, Tuple

from .errors import ServiceError, UnreachableError

# Said by proxies and by coordinators that go down or are overloaded: the same call may work later.
_PASSING_STATUSES = frozenset({429, 502, 503, 504})
_FIRST_PAUSE_SECONDS = 0.2
_LONGEST_PAUSE_SECONDS = 5.0
_READ_BYTES = 1 << 18

Headers = Mapping[str, str]


class Answer:
    """An answer whose body is still to be read. Close it, or use it in a with statement."""

    def __init__(self, connection: http.client.HTTPConnection, response: http.client.HTTPResponse) -> None:
        self._connection = connection
        self._response = response
        self.status = response.status

    def header(self, name: str) -> Optional[str]:
        return self._response.getheader(name)

    def read(self) -> bytes:
        return self._response.read()

    def pieces(self) -> Iterator[bytes]:
        """The body as it arrives. http.client.IncompleteRead when it breaks off."""
        while True:
            piece = self._response.read1(_READ_BYTES)
            if not piece:
                if self._response.length:
                    raise http.client.IncompleteRead(b"", self._response.length)
                return
            yield piece

    def close(self) -> None:
        self._connection.close()

    def __enter__(self) -> "Answer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Patience:
    """Pauses between attempts, until nothing has worked for so many seconds."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self.progress()

    def progress(self) -> None:
        """Something worked: the time begins anew."""
        self._deadline = time.monotonic() + self._seconds
        self._pause = _FIRST_PAUSE_SECONDS

    def wait(self, error: Exception) -> None:
        """Sleeps before the next attempt, or raises the error of the last one."""
        left = self._deadline - time.monotonic()
        if left <= 0:
            raise error
        time.sleep(min(self._pause, left))
        self._pause = min(2 * self._pause, _LONGEST_PAUSE_SECONDS)


class Transport:
    """Calls to one coordinator."""

    def __init__(
        self,
        url: str,
        token: Optional[str],
        timeout_seconds: float,
        retry_seconds: float,
        ssl_context: Optional[ssl.SSLContext],
    ) -> None:
        parts = urllib.parse.urlsplit(url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise ValueError(f'url is "{url}", expected http://HOST:PORT or https://HOST:PORT')
        self.url = url.rstrip("/")
        self.retry_seconds = retry_seconds
        self._is_secure = parts.scheme == "https"
        self._host = parts.hostname
        self._port = parts.port
        self._prefix = parts.path.rstrip("/")
        self._token = token
        self._timeout_seconds = timeout_seconds
        self._ssl_context = ssl_context

    def json(self, method: str, path: str, body: Any = None, query: Optional[Mapping[str, Any]] = None) -> Any:
        """The answer as JSON; None when it has no body."""
        headers = {} if body is None else {"Content-Type": "application/json"}
        data = None if body is None else json.dumps(body).encode()
        _, answer = self.repeat(method, path, data, query, headers)
        return json.loads(answer) if answer else None

    def repeat(
        self,
        method: str,
        path: str,
        body: Optional[bytes] = None,
        query: Optional[Mapping[str, Any]] = None,
        headers: Optional[Headers] = None,
    ) -> Tuple[Dict[str, str], bytes]:
        """Headers (names in lower case) and body of the answer. Repeats what did not arrive: for calls that may be."""

        def attempt() -> Tuple[Dict[str, str], bytes]:
            with self.open(method, path, body, query, headers) as answer:
                content = answer.read()
                return {name.lower(): value for name, value in answer._response.getheaders()}, content

        return self.patiently(attempt)

    def patiently(self, attempt: Callable[[], Any]) -> Any:
        """Calls `attempt` until it works, fails for good, or patience ends."""
        patience = Patience(self.retry_seconds)
        while True:
            try:
                return attempt()
            except ServiceError as error:
                if error.status not in _PASSING_STATUSES:
                    raise
                patience.wait(error)
            except (OSError, http.client.HTTPException) as error:
                patience.wait(self.unreachable(error))

    def open(
        self,
        method: str,
        path: str,
        body: Optional[bytes] = None,
        query: Optional[Mapping[str, Any]] = None,
        headers: Optional[Headers] = None,
    ) -> Answer:
        """One attempt. ServiceError when the coordinator says no; OSError or HTTPException when it says nothing."""
        target = self._prefix + path
        if query:
            target += "?" + urllib.parse.urlencode({name: value for name, value in query.items() if value is not None})
        sent = dict(headers or {})
        if self._token:
            sent["Authorization"] = f"Bearer {self._token}"
        connection: http.client.HTTPConnection
        if self._is_secure:
            connection = http.client.HTTPSConnection(
                self._host, self._port, timeout=self._timeout_seconds, context=self._ssl_context
            )
        else:
            connection = http.client.HTTPConnection(self._host, self._port, timeout=self._timeout_seconds)
        try:
            response = self._answer_to(connection, method, target, body, sent)
            answer = Answer(connection, response)
            if response.status >= 400:
                raise _problem(response.status, answer.read())
            return answer
        except BaseException:
            connection.close()
            raise

    @staticmethod
    def _answer_to(
        connection: http.client.HTTPConnection, method: str, target: str, body: Optional[bytes], headers: Headers
    ) -> http.client.HTTPResponse:
        try:
            connection.request(method, target, body=body, headers=dict(headers))
        except (BrokenPipeError, ConnectionResetError):
            # Whoever refuses a body early may have said why before it closed the connection.
            pass
        return connection.getresponse()

    def unreachable(self, error: Exception) -> UnreachableError:
        said = str(error) or type(error).__name__
        return UnreachableError(f'no answer from {self.url}: {said}; "meshwright up" starts a service on this machine')


def _problem(status: int, body: bytes) -> ServiceError:
    try:
        problem = json.loads(body)
        return ServiceError(problem["detail"], problem["code"], status, problem.get("field"))
    except (ValueError, KeyError, TypeError, AttributeError):
        # A proxy's page.
        words = http.client.responses.get(status, "")
        return ServiceError(f"HTTP status {status} {words}".rstrip(), "UNKNOWN", status)


def quote(text: str) -> str:
    """As one segment of a path."""
    return urllib.parse.quote(text, safe="")
