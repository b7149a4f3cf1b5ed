#!/usr/bin/python3
"""The query service against those who mean it harm: RQT_HOSTILE requests (10000) out of RQT_SEED.

SQL in every parameter, numbers of every kind, deep JSON, NaN, paths that climb, bytes that are no HTTP, bodies, pipelines, sockets
that are half closed, cut off or slow. What may come back is a refusal (4xx) or a good answer, whole and well formed; the service
lives, its memory stays bounded, its database stays as it is, nothing comes out of a file or a table that is not terrain, and
after it all it answers as before. Run with RQT naming a sanitized or a threads build, what the sanitizer says is a failure.
"""
import hashlib
import json
import os
import random
import re
import socket
import struct
import urllib.parse

import sql_support as s
from serve_support import PATIENCE, Service, seed, wait_until

check, equal = s.check, s.equal
dice = random.Random(seed())
COUNT = int(os.environ.get("RQT_HOSTILE", "10000"))
# What a service of these limits may hold; a sanitizer keeps freed memory and shadows for longer.
ROOM = int(os.environ.get("RQT_HOSTILE_MIB", "96")) << 20
SECRET = "swordfish-" + hashlib.sha256(b"rqt").hexdigest()[:12]

DB = s.temp("target.gpkg")
s.import_terrain(DB, s.write_grid(s.temp("g.asc"), s.rough_grid(140, 110, 3, voids=20), x0=-71, y0=44, cell=0.01, crs=s.WGS84), name="t", nodata=-9999, block=4)
raw = s.connect(DB)
raw.execute("CREATE TABLE secret(eps REAL, geom TEXT, word TEXT)")
raw.execute("INSERT INTO secret VALUES(1, ?1, ?1)", (SECRET,))
raw.execute("CREATE VIEW lifts AS SELECT rqt_limit('triangles', 0) AS eps, 'POINT(-70.5 44.5)' AS geom")
raw.close()
with open(s.temp("secret.txt"), "w") as f:
    f.write(SECRET)
with open(DB, "rb") as f:
    DIGEST = hashlib.sha256(f.read()).digest()

service = Service(DB, "--max-triangles", "20000", "--max-samples", "100000", "--max-bytes", "4000000", "--max-seconds", "1000", "--header-seconds", "1.5", "--memory", "512",
                  "--connections", "300")
T = "/collections/t"

# ------------------------------------------------------------------------------------------------------- ammunition
SQL = ["'", "''", "' OR 1=1 --", "1; DROP TABLE rqt_terrain; --", "t'; DELETE FROM rqt_terrain; --", "' UNION SELECT word FROM secret --", "\" OR \"\"=\"",
       "(SELECT word FROM secret)", "ATTACH DATABASE '%s' AS x" % s.temp("secret.txt"), "readfile('%s')" % s.temp("secret.txt"), "load_extension('x')", "PRAGMA writable_schema=1",
       "secret", "main.secret", "lifts", "sqlite_schema", "rqt_block_1", "temp.x", "?1", ":region", "$x", "@x", "/*", "*/", ";", "\\", "%s%n%x", "${jndi:ldap://x}", "<script>alert(1)</script>"]
NUMBERS = ["0", "-0", "1", "-1", "1e308", "-1e308", "1e309", "9e999", "-9e999", "1e-320", "0.1", ".5", "5.", "nan", "NaN", "-nan", "inf", "Infinity", "1e", "e1", "0x7fffffff", "0b1", "1_000",
           "2147483647", "2147483648", "-2147483648", "4294967296", "9223372036854775807", "9223372036854775808", "18446744073709551616", "1" * 400, "0." + "0" * 400 + "1", "1e99999999999",
           "+1", "++1", "--1", "1 ", " 1", "1,5", "٣", "１", "1\u200b", ""]
PATHS = ["../../../../etc/passwd", "..%2f..%2f..%2fetc%2fpasswd", "%2e%2e/%2e%2e/etc/passwd", "..\\..\\etc\\passwd", "....//....//etc/passwd", "/etc/passwd", "//etc/passwd", "proc/self/environ",
         "file:///etc/passwd", ".git/config", "index.html/../../../etc/passwd", "%00", "index.html%00.png", "web/index.html", "~root", "collections/../etc/passwd", "collections/t/../../etc/passwd",
         "collections/t/range/../../..", "collections/%74/%72ange", "collections//t", "collections/t/", "collections/t%20", "collections/T", "collections/t.", "%252e%252e%252f", "..;/", "?", "#", "*",
         "%c0%ae%c0%ae/etc/passwd", "\u2025/etc/passwd", "metrics/../healthz", s.temp("secret.txt"), s.temp("secret.txt").lstrip("/"), "." * 500, "a/" * 200, "%", "%%", "%1", "%zz"]
SHAPES = ["POINT(-70.5 44.5)", "LINESTRING(-71 44, -70 45)", "POLYGON((-71 44, -70 44, -70 45, -71 44))", "POLYGON EMPTY", "POINT", "POINT()", "POINT(1)", "POINT(nan nan)", "POINT(inf 1)",
          "POLYGON((0 0))", "POLYGON((", "POLYGON((-71 44,-70 45,-70 44,-71 45,-71 44))", "GEOMETRYCOLLECTION(POINT(1 1))", "CURVEPOLYGON(CIRCULARSTRING(0 0,1 1,2 0))", "SRID=4326;POINT(-70.5 44.5)",
          "SRID=-1;POINT(1 1)", "SRID=999999999999;POINT(1 1)", "SRID=3857;POINT(1 1)", "POINT(1e308 1e308)", "POLYGON((-1e300 -1e300, 1e300 -1e300, 1e300 1e300, -1e300 -1e300))",
          "MULTIPOINT(" + ",".join("%d %d" % (i, i) for i in range(300)) + ")", "GEOMETRYCOLLECTION(" * 200, "POLYGON(" + "(" * 300, "POINT Z(1 2 3)", "point(-70.5 44.5)", "POINT(-70.5\t44.5)", "\ufeffPOINT(1 1)"]
DEEP = ["[" * 5000, '{"a":' * 2000, "[" * 900 + "]" * 900, '{"mode":' + "[" * 500 + "]" * 500 + "}", '{"detail":' + "[" * 300 + "]" * 300 + "}"]
JSONS = ["{}", "[]", "null", "1", '"x"', "{", '{"mode":"cut"}', '{"mode":"cut","mode":"snap"}', '{"mode":null}', '{"mode":{"a":1}}', '{"max_vertices":1e999}', '{"max_vertices":-1}', '{"max_vertices":5}',
         '{"detail":"secret"}', '{"detail":"lifts"}', '{"detail":"sqlite_schema"}', '{"detail":"%s"}' % s.temp("secret.txt"), '{"detail":[["POINT(-70.5 44.5)",0]]}', '{"detail":[[1,2]]}', '{"detail":[]}',
         '{"frame":"ecef"}', '{"previous":"' + "x" * 3000 + '"}', '{"previous":""}', '{"test":"node"}', '{"\\u0000":1}', '{"mode":"\\ud800"}', "{'mode':'cut'}", '{"a":NaN}', '{"mode":"cut"}x', "\x01"] + DEEP
CAMERAS = ['{"eye":[-70.9,44.1,2500],"at":[-70.5,44.5,100],"fovy":45,"width":200,"height":100,"tau":2}', "{}", "null", '{"eye":[0,0,0]}', '{"eye":[-70.9,44.1,NaN],"at":[1,1,1]}',
           '{"eye":[1e308,1e308,1e308],"at":[-1e308,0,0],"fovy":1,"width":1,"height":1}', '{"eye":[-70.9,44.1,2500],"at":[-70.9,44.1,2500],"fovy":45,"width":200,"height":100}',
           '{"eye":[-70.9,44.1,2500],"yaw":1e300,"pitch":-1e300,"fovy":179.999,"width":1e9,"height":1e9,"tau":1e-300}', '{"eye":[-70.9,44.1,-1e7],"yaw":0,"pitch":0,"fovy":60,"width":100,"height":100,"exaggeration":-1}',
           '{"eye":[-70.9,44.1,2500],"yaw":0,"pitch":-90,"fovy":60,"width":100,"height":100,"tau":1,"near":1e9,"far":1}', '{"eye":[-70.9,44.1,2500],"yaw":10,"pitch":-10,"fovy":60,"width":100,"height":100,"tau":50,"extra":1}',
           '{"eye":["a",null,{}],"at":"x"}', '{"eye":[1,2]}', '{"eye":[-70.9,44.1,2500],"at":[-70.5,44.5,100],"fovy":45,"width":200,"height":100,"tau":0}'] + DEEP
BYTES = ["%00", "%FF", "%C0%AF", "%ED%A0%80", "%F4%90%80%80", "%", "%4", "%G0", "\x7f", "%0d%0aSet-Cookie:x=1", "%0a", "+" * 50, "&&&", "==", "%26eps=1", "a" * 4000]
ENDPOINTS = {"range": ["bbox", "wkt", "eps", "f", "options", "mode", "outline", "metric", "select", "strip", "detail", "max_vertices", "max_triangles", "frame", "test", "previous"],
             "view": ["camera", "f", "options", "outline", "metric", "max_triangles", "previous", "test"], "delta": ["bbox", "wkt", "eps_from", "eps_to"], "height": ["x", "y", "eps"],
             "profile": ["line", "eps"], "verify": ["bbox", "wkt", "eps", "options", "mode"], "explain": ["bbox", "wkt", "eps", "options"], "area": ["bbox", "wkt", "eps", "mode", "frame"]}
GOOD = {"eps": "5", "eps_from": "20", "eps_to": "5", "x": "-70.5", "y": "44.5", "line": SHAPES[1], "camera": CAMERAS[0], "bbox": "-70.9,44.2,-70.5,44.6", "f": "json"}
FORMATS = ["json", "geojson", "rqt", "rqt+normals", "rqt+errors", "rqt+normals+errors", "glb", "glb+quantized+normals", "obj", "ply", "ply+normals", "strip", "indexed", "wkb", "svg", "exe", "../obj", "obj;ls"]


def ammunition(name):
    """A value for a parameter: mostly what it might nearly take."""
    kind = dice.randrange(10)
    if kind == 0:
        return dice.choice(SQL)
    if kind == 1:
        return dice.choice(BYTES)
    if name in ("wkt", "line"):
        return dice.choice(SHAPES)
    if name in ("options", "detail"):
        return dice.choice(JSONS)
    if name == "camera":
        return dice.choice(CAMERAS)
    if name == "bbox":
        return ",".join(dice.choice(NUMBERS + ["-71", "44", "-70", "45"] * 8) for _ in range(dice.choice((4, 4, 4, 4, 3, 5, 0))))
    if name == "f":
        return dice.choice(FORMATS)
    if name in ("eps", "eps_from", "eps_to", "x", "y", "max_vertices", "max_triangles"):
        return dice.choice(NUMBERS)
    return dice.choice(["cut", "snap", "border", "cover", "tol", "exact", "minimal", "local", "wedgie", "euclid", "fan", "topdown", "bottomup", "ecef", "enu", "ulrich", ""] + SQL)


def quote(value):
    """Mostly as a client would write it, at times as it should not."""
    return value if dice.randrange(8) == 0 and "\n" not in value and " " not in value and value.isascii() else urllib.parse.quote(value, safe="%" if value in BYTES else "")


def query_target():
    endpoint = dice.choice(list(ENDPOINTS))
    names = ENDPOINTS[endpoint]
    values = {name: GOOD[name] for name in names if name in GOOD and name not in ("bbox", "f")}
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        name = dice.choice(names)
        values[name] = ammunition(name)
    pairs = ["%s=%s" % (name, quote(value)) for name, value in values.items()]
    if dice.randrange(12) == 0:
        pairs.append(dice.choice(pairs))
    if dice.randrange(20) == 0:
        pairs.append("%s=%s" % (quote(dice.choice(SQL)), quote(dice.choice(SQL))))
    terrain = quote(dice.choice(SQL + PATHS)) if dice.randrange(15) == 0 else "t"
    return "/collections/%s/%s?%s" % (terrain, endpoint, "&".join(pairs))


HEADERS = [b"", b"Accept: */*\r\n", b"Accept: " + b"a/b;q=0.1," * 500 + b"\r\n", b"Accept-Encoding: gzip;q=nan, zstd;q=1e9, *;q=-1\r\n", b"Accept-Encoding: " + b"," * 3000 + b"\r\n", b"If-None-Match: \"" + b"x" * 3000 + b"\r\n",
           b"If-None-Match: *\r\n", b"If-None-Match: W/W/W/\"\r\n", b"Accept: text/html\r\n", b"Cookie: " + b"a" * 5000 + b"\r\n", b"Range: bytes=0-1\r\n", b"X-Forwarded-For: ' OR 1=1\r\n", b"Connection: upgrade\r\nUpgrade: h2c\r\n",
           b"Accept-Encoding: gzip\r\n", b"Accept-Encoding: zstd\r\n", b"Transfer-Encoding: identity\r\n", b"Origin: null\r\n", b"Accept: \xff\xfe\r\n"]


def get(target, method=b"GET", extra=b""):
    return method + b" " + target.encode("utf-8", "surrogatepass") + b" HTTP/1.1\r\nHost: x\r\n" + extra + b"\r\n"


GARBAGE = [b"\r\n\r\n", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", b"GET\r\n\r\n", b"GET /\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n", b"GET  / HTTP/1.1\r\nHost: x\r\n\r\n", b"\x00" * 200, b"GET / HTTP/1.1\r\nHost x\r\n\r\n",
           b"GET / HTTP/1.1\r\nHost: x\r\nContent-Length: -1\r\n\r\n", b"GET / HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999999999999\r\n\r\n", b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\nhello",
           b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffffffff\r\nx", b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n-1\r\n\r\n", b"POST / HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\nContent-Length: 10\r\n\r\n",
           b"PUT /etc/passwd HTTP/1.1\r\nHost: x\r\nContent-Length: 3\r\n\r\nabc", b"CONNECT x:1 HTTP/1.1\r\nHost: x\r\n\r\n", b"TRACE / HTTP/1.1\r\nHost: x\r\n\r\n", b"GET " + b"/" * 200000 + b" HTTP/1.1\r\nHost: x\r\n\r\n", b"A" * 150000,
           b"GET / HTTP/1.1\r\nHost: x\r\n" + b"X: y\r\n" * 30000 + b"\r\n", b"GET / HTTP/1.1\r\nHost: x\r\nX: " + b"y" * 200000 + b"\r\n\r\n", b"GET / HTTP/1.1\nHost: x\n\n", b"GET / HTTP/1.1\r\n Host: x\r\n\r\n", b"GET http:// HTTP/1.1\r\nHost: x\r\n\r\n",
           b"GET http://x HTTP/1.1\r\nHost: x\r\n\r\n", b"GET x HTTP/1.1\r\nHost: x\r\n\r\n", b"OPTIONS * HTTP/1.1\r\nHost: x\r\n\r\n", b"* * *\r\n\r\n", b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n", b"GET /healthz HTTP/1.0\r\n\r\n", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
           b"GET / HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", b"HEAD /collections HTTP/1.1\r\nHost: x\r\n\r\n", b"get / http/1.1\r\nhost: x\r\n\r\n", b"G\x00T / HTTP/1.1\r\nHost: x\r\n\r\n"]

# ---------------------------------------------------------------------------------------------------------- the client


def connect():
    sock = socket.create_connection(("127.0.0.1", service.port), timeout=PATIENCE)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return sock


class Reader:
    """Answers off a socket, one after the other."""

    def __init__(self, sock):
        self.sock, self.bytes = sock, b""

    def more(self):
        try:
            got = self.sock.recv(1 << 16)
        except ConnectionError:
            got = b""
        self.bytes += got
        return got

    def answer(self, is_head=False):
        """(status, headers, body); None at the end; raises on what is no HTTP."""
        while b"\r\n\r\n" not in self.bytes:
            if not self.more():
                return None
        head, self.bytes = self.bytes.split(b"\r\n\r\n", 1)
        lines = head.decode("latin-1").split("\r\n")
        status = int(re.fullmatch(r"HTTP/1\.[01] (\d{3}) .*", lines[0]).group(1))
        headers = {name.lower(): value for name, value in (line.split(": ", 1) for line in lines[1:])}
        if status == 100:
            return self.answer(is_head)
        length = 0 if is_head or status in (204, 304) else int(headers["content-length"])
        while len(self.bytes) < length:
            if not self.more():
                return (status, headers, None)
        body, self.bytes = self.bytes[:length], self.bytes[length:]
        return (status, headers, body)


counts, bad = {}, []
sent = 0
REFUSALS = {400, 404, 405, 406, 411, 413, 414, 417, 426, 431, 501, 505}  # the last two are the library's, of no HTTP that it knows


def judge(answer, what):
    """Refused, or good and whole."""
    global sent
    sent += 1
    status, headers, body = answer
    counts[status] = counts.get(status, 0) + 1
    fine = status in (200, 204, 304) or status in REFUSALS
    kind, packed = headers.get("content-type", ""), "content-encoding" in headers
    if body is None or not fine:
        bad.append((status, what[:300], (body or b"cut off")[:300]))
    elif body and not packed and "json" in kind:
        try:
            document = json.loads(body)
            if status >= 400 and (document["status"] != status or not document["detail"]):
                bad.append(("problem", what[:300], body[:300]))
        except ValueError:
            bad.append(("no JSON", what[:300], body[:300]))
    if body and (SECRET.encode() in body or b"root:" in body or s.TEMP.encode() in body):
        # What was in the request may be in the sentence about it.
        if not (s.TEMP.encode() in body and s.temp("secret.txt").encode() in urllib.parse.unquote_to_bytes(what)):
            bad.append(("leak", what[:300], body[:300]))


def burst(requests):
    """Over one connection, all written before one answer is read; where the service ends it, on with a new one."""
    at = 0
    while at < len(requests):
        sock = connect()
        reader = Reader(sock)
        try:
            sock.sendall(b"".join(requests[at:]))
        except ConnectionError:
            pass
        begun = at
        while at < len(requests):
            answer = reader.answer(requests[at].startswith(b"HEAD"))
            if answer is None:
                break
            judge(answer, requests[at])
            at += 1
            if answer[1].get("connection", "").lower() == "close":
                break
        if at == begun:  # closed without a word: of what is no HTTP
            counts["closed"] = counts.get("closed", 0) + 1
            at += 1
        sock.close()


def alone(request, how):
    """One request over a connection that is then cut in some way."""
    global sent
    sock = connect()
    try:
        if how == "half":
            sock.sendall(request)
            sock.shutdown(socket.SHUT_WR)
        elif how == "reset":
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            sock.sendall(request)
            sock.close()
            sent += 1
            return
        elif how == "part":
            sock.sendall(request[:dice.randrange(1, len(request))])
            sock.shutdown(socket.SHUT_WR)
        elif how == "leaves":
            sock.sendall(request)
            sock.recv(1)
            sock.close()
            sent += 1
            return
        else:
            for piece in [request[i:i + 7] for i in range(0, min(len(request), 400), 7)] + [request[400:]]:
                sock.sendall(piece)
        answer = Reader(sock).answer(request.startswith(b"HEAD"))
        if answer:
            judge(answer, request)
        else:
            sent += 1
            counts["closed"] = counts.get("closed", 0) + 1
    except OSError:
        sent += 1
    sock.close()


# ------------------------------------------------------------------------------------------------------------- the run
probe = T + "/range?eps=20&f=obj"
before = service.ask(probe)
equal("a good answer before", before.status, 200)
for warm in ("/range?eps=0&f=ply", "/verify?eps=1", "/range?eps=2&metric=minimal&f=rqt"):
    service.ask(T + warm)
base = service.memory()

# Slow ones first, so that they age meanwhile: a byte now and then, or nothing at all.
loris = [connect() for _ in range(60)]
for sock in loris[:30]:
    sock.sendall(b"GET /healthz HTTP/1.1\r\nHost: x\r\nX-Slow: ")


def feed():
    """Of the slow ones that still write, how many the service takes."""
    taken = 0
    for sock in loris[:30]:
        try:
            sock.send(b"x")
            taken += 1
        except OSError:
            pass
    return taken


feed()
largest = base
def attack():
    """Some requests of one kind."""
    global largest
    kind = dice.randrange(20)
    if kind < 12:
        burst([get(query_target(), dice.choice((b"GET", b"GET", b"GET", b"HEAD")), dice.choice(HEADERS) if dice.randrange(3) == 0 else b"") for _ in range(dice.choice((1, 5, 40)))])
    elif kind < 15:
        burst([get("/" + dice.choice(PATHS).replace(" ", "%20"), dice.choice((b"GET", b"HEAD", b"OPTIONS", b"POST", b"DELETE", b"PROPFIND")), dice.choice(HEADERS)) for _ in range(20)])
    elif kind < 17:
        alone(dice.choice(GARBAGE), dice.choice(("half", "half", "part")))
    else:
        alone(get(query_target() if dice.randrange(2) else T + "/range?eps=0&f=geojson"), dice.choice(("half", "reset", "part", "leaves", "slow")))
    if kind == 19:
        feed()
        largest = max(largest, service.memory())


try:
    while sent < COUNT and service.is_alive():
        attack()
except OSError as error:
    print("after %d requests: %s" % (sent, error))

print("%d requests: %s" % (sent, ", ".join("%s: %d" % (key, counts[key]) for key in sorted(counts, key=str))))
check("the service lives after %d requests" % COUNT, service.is_alive() and sent >= COUNT, sent)
check("every answer refuses or is good, whole and well formed", not bad, bad[:5])
check("there were good ones, and refusals of many kinds", counts.get(200, 0) > COUNT // 20 and all(counts.get(code, 0) for code in (400, 404, 405, 413)), counts)
if service.is_alive():
    check("slow clients are shown the door", wait_until(lambda: not feed(), 30))
    idle = loris[59]
    idle.settimeout(PATIENCE)
    equal("and those who say nothing", idle.recv(10), b"")
    for sock in loris:
        sock.close()

    # More connections than there may be: those that are in are served, and when they go the others are.
    crowd = []
    for _ in range(400):
        try:
            crowd.append(connect())
        except OSError:
            pass
    for sock in crowd:
        sock.close()
    check("a crowd leaves, and all is as before", wait_until(lambda: service.ask("/healthz", connection=service.connect()).status == 200))
    again = service.ask(probe, connection=service.connect())
    equal("it answers as before", (again.status, again.etag, again.body), (before.status, before.etag, before.body))
    largest = max(largest, service.memory())
    check("memory is bounded: %d MiB more than at first" % ((largest - base) >> 20), largest - base < ROOM, "%d MiB" % ((largest - base) >> 20))
    names = [name for name in service.open_files() if name.startswith("/") and not name.startswith(("/dev/", "/proc/"))]
    check("no file is open but the database and our log", all(os.path.basename(name) in ("target.gpkg", "serve.log") for name in names), names)
    sockets = [name for name in service.open_files() if name.startswith("socket:")]
    check("no connection is left open", len(sockets) < 20, len(sockets))
with open(DB, "rb") as f:
    check("the database is as it was, byte for byte", hashlib.sha256(f.read()).digest() == DIGEST)
status, said = service.stop()
print(said)
equal("it ends as it should, and no sanitizer has anything to say", (status, said), (0, ""))
s.finish()
