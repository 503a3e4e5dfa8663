"""Plain requests to the explorer, with exactly the headers that a test wants."""

from http.client import HTTPConnection
from urllib.parse import urlsplit


def got(address, path="", headers=None, host=None, method="GET"):
    """Status and body of a request, with exactly these headers."""
    parts = urlsplit(address)
    connection = HTTPConnection(parts.hostname, parts.port, timeout=20)
    connection.putrequest(method, parts.path + path, skip_host=True)
    connection.putheader("Host", host or parts.netloc)
    for name, value in (headers or {}).items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body
