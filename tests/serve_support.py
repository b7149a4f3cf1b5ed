"""What the tests of the query service share: a service on a port of its own, and a client."""
import ctypes
import http.client
import json
import os
import signal
import subprocess
import sys
import time
import urllib.parse

import sql_support as s

# A sanitized service is slower to start and to answer.
PATIENCE = 120


class Answer:
    def __init__(self, response, body):
        self.status, self.body = response.status, body
        self.headers = {name.lower(): value for name, value in response.getheaders()}

    def __getattr__(self, name):  # answer.etag, answer.content_type
        return self.headers.get(name.replace("_", "-"))

    def json(self):
        return json.loads(self.body)

    def detail(self):
        """The sentence of a problem, with its status; something else when it is none."""
        if self.content_type != "application/problem+json":
            return "no problem: %s %s" % (self.status, self.content_type)
        problem = self.json()
        return problem["detail"] if problem["status"] == self.status else "problem of %s" % problem["status"]


class Nothing(Answer):
    """Instead of an answer, where none came."""

    def __init__(self):
        self.status, self.body, self.headers = 0, b"", {}

    def json(self):
        return {}


def ends_with_parent():
    """However a test ends, killed too, its service does not go on without it."""
    PR_SET_PDEATHSIG = 1
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


class Service:
    def __init__(self, *arguments, **environment):
        self.log = open(s.temp("serve.log"), "w+")
        self.process = subprocess.Popen([s.RQT, "serve", "--port", "0", *arguments], stdout=subprocess.PIPE, stderr=self.log, text=True,
                                        env=dict(os.environ, **environment), preexec_fn=ends_with_parent)
        self.url = self.process.stdout.readline().strip()
        self.port = int(urllib.parse.urlsplit(self.url).port or 0) if self.url else 0
        self.connection = None

    def connect(self):
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)

    def ask(self, path, parameters=None, method="GET", headers=None, body=None, connection=None):
        """Parameters are encoded; a path is sent as it stands."""
        if parameters:
            path += "?" + urllib.parse.urlencode(parameters)
        mine = connection or self.connection or self.connect()
        if not connection:
            self.connection = mine
        for _ in range(2):  # a connection that was kept may have been closed meanwhile
            try:
                mine.request(method, path, body=body, headers=headers or {})
                response = mine.getresponse()
                return Answer(response, response.read())
            except (http.client.HTTPException, ConnectionResetError, BrokenPipeError):
                mine.close()
        return Nothing()

    def is_alive(self):
        return self.process.poll() is None

    def memory(self):
        """Resident bytes."""
        with open("/proc/%d/statm" % self.process.pid) as f:
            return int(f.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def open_files(self):
        folder = "/proc/%d/fd" % self.process.pid
        found = []
        for name in os.listdir(folder):
            try:
                found.append(os.readlink(os.path.join(folder, name)))
            except OSError:
                pass
        return found

    def stop(self, number=signal.SIGTERM):
        """Its exit status, and what it said on stderr."""
        if self.is_alive():
            self.process.send_signal(number)
        try:
            status = self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            status = self.process.wait()
        self.process.stdout.close()
        self.log.seek(0)
        said = self.log.read()
        self.log.close()
        return status, said


def wait_until(fine, seconds=PATIENCE):
    end = time.monotonic() + seconds
    while not fine():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def seed():
    """RQT_SEED, printed, so that a run can be repeated."""
    value = int(os.environ.get("RQT_SEED", "1"))
    print("seed %d" % value)
    sys.stdout.flush()
    return value
