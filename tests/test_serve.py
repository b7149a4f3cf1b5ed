#!/usr/bin/python3
"""The query service against SQL's own answers, byte for byte, and against HTTP: negotiation, tags, errors, its end, and what
happens when a database changes, is replaced or is damaged under it."""
import gzip
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import threading
import time

import sql_support as s
from serve_support import Service, wait_until

check, equal = s.check, s.equal
DB = s.temp("two.gpkg")
s.import_terrain(DB, s.DEMO, name="hills")
flat = s.write_grid(s.temp("flat.asc"), s.rough_grid(130, 97, 7, voids=20), x0=1000, y0=2000, cell=25)
s.import_terrain(DB, flat, name="plain", nodata=-9999)
db = s.connect(DB)

BOX = "-71.32,44.25,-71.28,44.29"
WKT = "POLYGON((-71.4 44.2, -71.2 44.2, -71.3 44.3, -71.4 44.2))"
CAMERA = json.dumps({"eye": [-71.5, 44.1, 2500], "at": [-71.3033, 44.2705, 1500], "fovy": 45, "width": 640, "height": 480, "tau": 3})
HILLS = "/collections/hills"
service = Service(DB, "--max-seconds", "1000")
ask = service.ask
s.check("the service says where it listens, on this machine alone", re.fullmatch(r"http://127\.0\.0\.1:\d+/", service.url), service.url)

# ------------------------------------------------------------------------------------------- meshes, byte for byte
TYPES = {"rqt": "application/vnd.rqt.mesh", "rqt+normals": "application/vnd.rqt.mesh", "rqt+errors": "application/vnd.rqt.mesh",
         "rqt+normals+errors": "application/vnd.rqt.mesh", "obj": "model/obj", "ply": "application/x-ply",
         "ply+normals": "application/x-ply", "strip": "application/vnd.rqt.strip", "indexed": "application/vnd.rqt.indexed",
         "wkb": "application/vnd.rqt.wkb"}
TYPES.update((name, "model/gltf-binary") for name in ("glb", "glb+normals", "glb+quantized", "glb+quantized+normals"))


def sql_bytes(sql, *arguments):
    value = s.one(db, sql, *arguments)
    return value.encode() if isinstance(value, str) else value


TOLD = {"vertices": "rqt-vertices", "triangles": "rqt-triangles", "achieved_eps": "rqt-achieved-eps", "achieved_tau": "rqt-achieved-tau",
        "guaranteed": "rqt-guaranteed", "token": "rqt-token"}


def told(answer):
    return {name: value for name, value in answer.headers.items() if name.startswith("rqt-")}


def told_by(sql, *arguments):
    """What a row says, as headers."""
    cursor = db.execute(sql, arguments)
    return {TOLD[column[0]]: "9e999" if value == float("inf") else re.sub(r"\.0$", "", repr(value)) if isinstance(value, float) else str(value)
            for column, value in zip(cursor.description, cursor.fetchone()) if value is not None}


for name, kind in sorted(TYPES.items()):
    for region, words in ((WKT, {"wkt": WKT}), (None, {"bbox": BOX})):
        sql = "SELECT rqt_mesh(%s, 10, ?2, 'hills', ?1)" % ("?3" if region else "rqt_bbox(%s)" % BOX)
        expected = sql_bytes(sql, None, name, *([region] if region else []))
        answer = ask(HILLS + "/range", dict(words, eps=10, f=name))
        equal("range as %s by %s is rqt_mesh's bytes" % (name, list(words)[0]), (answer.status, answer.content_type, answer.body),
              (200, kind, expected))
        equal("and its headers tell what rqt_answer does (%s by %s)" % (name, list(words)[0]), told(answer), told_by(
            "SELECT vertices, triangles, achieved_eps FROM rqt_answer(%s, 10, ?1, 'hills')" % ("?2" if region else "rqt_bbox(%s)" % BOX),
            name, *([region] if region else [])))
    for cover in ({}, {"cover": "terrain"}):
        answer = ask(HILLS + "/view", dict(cover, camera=CAMERA, f=name))
        equal("view as %s %s is rqt_view_mesh's bytes" % (name, cover), (answer.status, answer.content_type, answer.body),
              (200, kind, sql_bytes("SELECT rqt_view_mesh(?1, ?2, 'hills', ?3)", CAMERA, name, json.dumps(cover))))
        equal("and its headers tell what rqt_view_answer does (%s %s)" % (name, cover), told(answer), told_by(
            "SELECT vertices, triangles, achieved_tau, guaranteed, token FROM rqt_view_answer(?1, ?2, 'hills', ?3)", CAMERA, name, json.dumps(cover)))


def one_row(sql, *arguments):
    return s.one(db, sql, *arguments)


def finite(rows):
    return [[None if isinstance(v, float) and v in (float("inf"), float("-inf")) else v for v in row] for row in rows]


answer = ask(HILLS + "/range", {"wkt": WKT, "eps": 30})
equal("range without f is JSON of rqt_range's rows", (answer.content_type, answer.json()["rows"]),
      ("application/json", finite(s.rows(db, "SELECT * FROM rqt_range(?1, 30, 'hills')", WKT))))
equal("and says the eps that was achieved", answer.json().get("achieved_eps"), 30)
answer = ask(HILLS + "/range", {"eps": "9e999"})
equal("range of everything at the coarsest eps, infinite errors null", answer.json()["rows"],
      finite(s.rows(db, "SELECT * FROM rqt_range(NULL, 9e999, 'hills')")))
check("there are such errors", any(row[3] is None for row in answer.json()["rows"]))
answer = ask(HILLS + "/view", {"camera": CAMERA})
equal("view without f is JSON of rqt_view's rows", answer.json()["rows"], finite(s.rows(db, "SELECT * FROM rqt_view(?1, 'hills')", CAMERA)))
for path, sql in ((HILLS + "/range?eps=30", "rqt_range(NULL, 30, 'hills')"), (HILLS + "/range?eps=9e999&f=geojson", "rqt_triangles(NULL, 9e999, 'hills')"),
                  (HILLS + "/range?eps=0&max_vertices=3000", "rqt_range(NULL, 0, 'hills', '{\"max_vertices\":3000}')")):
    equal("headers of rows (%s)" % path, told(ask(path)), told_by("SELECT vertices, triangles, achieved_eps FROM " + sql))
for name in ("json", "geojson"):
    equal("headers of a view's rows (%s)" % name, told(ask(HILLS + "/view", {"camera": CAMERA, "f": name, "previous": "", "max_triangles": 2000})), told_by(
        "SELECT vertices, triangles, achieved_tau, guaranteed, token FROM rqt_view(?1, 'hills', '{\"previous\":\"\",\"max_triangles\":2000}')", CAMERA))
    equal("of rows that are none (%s)" % name, told(ask(HILLS + "/range", {"wkt": "POINT(0 0)", "eps": 7, "f": name})),
          {"rqt-vertices": "0", "rqt-triangles": "0", "rqt-achieved-eps": "7"})
    equal("of a view that sees nothing (%s)" % name, told(ask(HILLS + "/view", {"camera": CAMERA.replace('"at": [-71.3033, 44.2705, 1500]', '"yaw": 0, "pitch": 89'), "f": name})),
          {"rqt-vertices": "0", "rqt-triangles": "0", "rqt-achieved-tau": "3", "rqt-guaranteed": "1"})
equal("JSON says the same", {TOLD[key]: str(value) for key, value in ask(HILLS + "/range?eps=30").json().items() if key in TOLD}, told(ask(HILLS + "/range?eps=30")))
token, steps = "", []
for step in range(3):
    answer = ask(HILLS + "/view", {"camera": CAMERA, "f": "increment", "previous": token, "cover": "terrain"})
    expected = one_row("SELECT mesh, token FROM rqt_view_answer(?1, 'increment', 'hills', ?2)", CAMERA, json.dumps({"previous": token, "cover": "terrain"}))
    equal("increment %d: rqt_view_mesh's bytes, and the token in a header" % step, (answer.status, answer.content_type, answer.body, answer.rqt_token),
          (200, "application/vnd.rqt.increment", *expected))
    token = answer.rqt_token or ""
    steps.append(len(answer.body))
equal("which is packed already", ask(HILLS + "/view", {"camera": CAMERA, "f": "increment", "previous": ""}, headers={"Accept-Encoding": "gzip"}).content_encoding, None)
equal("which are few where nothing changes", steps[1:], [48, 48])
check("increments are of views", 'format "increment" is for views' in ask(HILLS + "/range?eps=1&f=increment").detail())
answer = ask(HILLS + "/view", {"camera": CAMERA})
equal("and says what is promised", (answer.json()["achieved_tau"], answer.json()["guaranteed"]),
      s.one(db, "SELECT achieved_tau, guaranteed FROM rqt_view(?1, 'hills') LIMIT 1", CAMERA))

answer = ask(HILLS + "/range", {"wkt": WKT, "eps": 50, "f": "geojson"})
features = answer.json()["features"]
expected = [[r[0], [[list(r[1:4]), list(r[4:7]), list(r[7:10]), list(r[1:4])]]] for r in s.rows(db, "SELECT * FROM rqt_triangles(?1, 50, 'hills')", WKT)]
equal("range as GeoJSON is rqt_triangles' rows", [[f["id"], f["geometry"]["coordinates"]] for f in features], expected)
equal("with GeoJSON's media type and no CRS of its own", (answer.content_type, "crs" in answer.json()), ("application/geo+json", False))
with open(s.temp("answer.geojson"), "wb") as f:
    f.write(answer.body)
said, status = s.run(["ogrinfo", "-ro", "-al", "-so", s.temp("answer.geojson")])
check("OGR reads it", status == 0 and "Feature Count: %d" % len(expected) in said, said)

OPTIONS = [{"mode": "cut"}, {"mode": "snap"}, {"mode": "border"}, {"max_vertices": 200}, {"outline": "tol"}, {"metric": "local"}, {"strip": "fan"},
           {"frame": "ecef"}, {"detail": [["POINT(-71.3 44.25)", 1]]}, {"mode": "snap", "select": "topdown"}]
for options in OPTIONS:
    text = json.dumps(options)
    expected = sql_bytes("SELECT rqt_mesh(?1, 20, 'obj', 'hills', ?2)", WKT, text)
    answer = ask(HILLS + "/range", {"wkt": WKT, "eps": 20, "f": "obj", "options": text})
    equal("options %s as JSON" % text, answer.body, expected)
    single = {key: value if isinstance(value, (str, int)) else json.dumps(value) for key, value in options.items()}
    answer = ask(HILLS + "/range", dict(single, wkt=WKT, eps=20, f="obj"))
    equal("options %s as parameters" % text, answer.body, expected)
answer = ask(HILLS + "/range", {"wkt": WKT, "eps": 20, "f": "obj", "options": '{"mode":"snap"}', "select": "topdown"})
equal("some one way and some the other", answer.body, sql_bytes("SELECT rqt_mesh(?1, 20, 'obj', 'hills', '{\"mode\":\"snap\"}')", WKT))
equal("rqt with a blank for its + is meant with it", ask(HILLS + "/range?eps=50&f=rqt+normals").body, sql_bytes("SELECT rqt_mesh(NULL, 50, 'rqt+normals', 'hills')"))

answer = ask(HILLS + "/delta", {"wkt": WKT, "eps_from": 20, "eps_to": 10})
equal("delta is rqt_delta's bytes", (answer.content_type, answer.body),
      ("application/vnd.rqt.delta", sql_bytes("SELECT rqt_delta(?1, 20, 10, 'hills')", WKT)))

said, status = s.run([s.RQT, "mesh", DB, "--terrain", "hills", "--eps", "20", "--region", BOX, "--width", "1200", "-o", s.temp("picture.svg")])
equal("(rqt mesh)", (said, status), ("", 0))
with open(s.temp("picture.svg"), "rb") as f:
    picture = f.read()
answer = ask(HILLS + "/range", {"bbox": BOX, "eps": 20, "f": "svg"})
equal("svg is the picture that rqt mesh draws", (answer.status, answer.content_type, answer.body == picture and len(picture) > 10000), (200, "image/svg+xml", True))
answer = ask(HILLS + "/range", {"wkt": "POINT(0 0)", "eps": 20, "f": "svg"})
check("of what is elsewhere there is none", answer.status == 400 and "there is nothing to draw" in answer.detail(), answer.body)
check("nor of a view", "a view has no format" in ask(HILLS + "/view", {"camera": CAMERA, "f": "svg"}).detail())

# ------------------------------------------------------------------------------------------------- heights and insight
for x, y, eps in ((-71.3033, 44.2705, 0), (-71.3033, 44.2705, 20), (-71.5, 44.5, 3.5), (10, 10, 0)):
    answer = ask(HILLS + "/height", {"x": x, "y": y, "eps": eps})
    equal("height at %s %s on the mesh of %s" % (x, y, eps), answer.json(),
          {"x": x, "y": y, "eps": eps, "z": s.one(db, "SELECT rqt_height(?1, ?2, ?3, 'hills')", x, y, eps)})
equal("height without eps is that of the samples", ask(HILLS + "/height", {"x": -71.3033, "y": 44.2705}).json()["z"],
      s.one(db, "SELECT rqt_height(-71.3033, 44.2705, 0, 'hills')"))
LINE = "LINESTRING(-71.4 44.2, -71.3033 44.2705)"


def table(answer, sql, *arguments):
    cursor = db.execute(sql, arguments)
    return (answer.status, answer.json()["columns"], answer.json()["rows"]), (200, [c[0] for c in cursor.description], finite(cursor.fetchall()))


def document(answer, sql, *arguments):
    cursor = db.execute(sql, arguments)
    return (answer.status, answer.json()), (200, dict(zip([c[0] for c in cursor.description], cursor.fetchone())))


equal("profile", *table(ask(HILLS + "/profile", {"line": LINE, "eps": 10}), "SELECT * FROM rqt_profile(?1, 10, 'hills')", LINE))
equal("profile without eps", *table(ask(HILLS + "/profile", {"line": LINE}), "SELECT * FROM rqt_profile(?1, 0, 'hills')", LINE))
equal("verify", *document(ask(HILLS + "/verify", {"wkt": WKT, "eps": 10}), "SELECT * FROM rqt_verify(?1, 10, 'hills')", WKT))
equal("verify of a cut", *document(ask(HILLS + "/verify", {"wkt": WKT, "eps": 10, "mode": "cut"}),
                                   "SELECT * FROM rqt_verify(?1, 10, 'hills', '{\"mode\":\"cut\"}')", WKT))
equal("area", *document(ask(HILLS + "/area", {"wkt": WKT, "eps": 10}), "SELECT * FROM rqt_area(?1, 10, 'hills')", WKT))
answer = ask(HILLS + "/explain", {"wkt": WKT, "eps": 10})
seen, expected = table(answer, "SELECT * FROM rqt_explain(?1, 10, 'hills')", WKT)
equal("explain, but for what is cached", [r[:4] + r[5:] for r in seen[2]], [list(r[:4] + r[5:]) for r in s.rows(db, "SELECT * FROM rqt_explain(?1, 10, 'hills')", WKT)])
equal("a terrain without an EPSG code", *document(ask("/collections/plain/verify", {"eps": 3}), "SELECT * FROM rqt_verify(NULL, 3, 'plain')"))

# ------------------------------------------------------------------------------------------------------ documents
answer = ask("/")
equal("/ is the landing page in JSON for programs", (answer.status, answer.content_type), (200, "application/json"))
links = {link["rel"]: link["href"] for link in answer.json()["links"]}
for rel in ("self", "service-desc", "conformance", "data", "alternate"):
    equal("its link %s leads somewhere" % rel, ask(links[rel]).status, 200)
browser = "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"
answer = ask("/", headers={"Accept": browser})
equal("/ is a page for browsers", (answer.content_type, b"<!doctype html>" in answer.body.lower()), ("text/html; charset=utf-8", True))
check("which may load nothing from elsewhere", "default-src 'self'" in (answer.content_security_policy or ""), answer.headers)
equal("and varies with Accept", "Accept" in answer.vary.split(", "), True)
equal("f decides over Accept", ask("/?f=json", headers={"Accept": browser}).content_type, "application/json")
with open(os.path.join(s.ROOT, "src", "serve", "openapi.json"), "rb") as f:
    source = f.read()
answer = ask("/openapi.json")
equal("/openapi.json is the document of src/serve", (answer.content_type, answer.body), ("application/vnd.oai.openapi+json;version=3.0", source))
for header, expected in (("gzip", "gzip"), ("gzip, zstd", "gzip"), ("gzip;q=0.5, zstd", "zstd"), ("identity", None)):
    answer = ask("/openapi.json", headers={"Accept-Encoding": header})
    body = gzip.decompress(answer.body) if answer.content_encoding == "gzip" else answer.body
    check("what is compiled in is gzipped already: %s is answered in %s" % (header, expected), answer.content_encoding == expected and (expected == "zstd" or body == source), answer.headers)
answer = ask("/cesium", {"terrain": "hills"}, headers={"Accept": browser})
equal("/cesium is a page for browsers", (answer.content_type, b"<!doctype html>" in answer.body.lower()), ("text/html; charset=utf-8", True))
check("which may load nothing from elsewhere, and compile nothing", "default-src 'self'" in (answer.content_security_policy or "") and "eval" not in answer.content_security_policy, answer.headers)
check("/conformance names classes of OGC API", any("ogcapi-common-1/1.0/conf/core" in c for c in ask("/conformance").json()["conformsTo"]))
answer = ask("/collections").json()
equal("/collections lists the terrains", [c["id"] for c in answer["collections"]], ["hills", "plain"])
check("and no problem", "problems" not in answer)
hills, plain = answer["collections"]
equal("a collection is what its own path says", ask(HILLS).json(), hills)
equal("its extent is that of its samples, in CRS84", hills["extent"]["spatial"],
      {"bbox": [[-72, 44, -71, 45]], "crs": "http://www.opengis.net/def/crs/OGC/1.3/CRS84"})
equal("without a known CRS there is none", plain["extent"]["spatial"], {"bbox": [[1000, 2000, 1000 + 129 * 25, 2000 + 96 * 25]]})
row = dict(zip(("width", "height", "min_z", "max_z", "blocks", "bytes"),
               s.one(db, "SELECT width, height, min_z, max_z, blocks, bytes FROM rqt_terrains WHERE name = 'hills'")))
equal("it tells what rqt_terrains does", {key: hills["terrain"][key] for key in row}, row)
space = dict(zip(("srid", "crs_name", "x0", "y0", "dx", "dy", "quantum_error", "lonlat", "semi_major", "inverse_flattening"), one_row(
    "SELECT srid, crs_name, x0, y0, dx, dy, quantum_error, lonlat, semi_major, inverse_flattening FROM rqt_terrains WHERE name = 'hills'")))
equal("and what makes places in space", {key: hills["terrain"].get(key) for key in space}, space)
equal("of a plane terrain the metres of a unit", (plain["terrain"]["lonlat"], plain["terrain"]["metre"], "semi_major" in plain["terrain"]), (0, 1, False))
check("and not where it came from on this machine", "source" not in hills["terrain"])

# OpenAPI: what it describes is what there is.
api = json.loads(source)
EXAMPLES = {"terrain": "hills"}


def parameters_of(operation):
    for p in operation["parameters"]:
        if "$ref" in p:
            p = api["components"]["parameters"][p["$ref"].split("/")[-1]]
        yield p


for path, item in sorted(api["paths"].items()):
    named = {p["name"]: p for p in parameters_of(item["get"]) if p["in"] == "query"}
    needed = {name: p["example"] if isinstance(p["example"], (str, int, float)) else ",".join(map(str, p["example"]))
              for name, p in named.items() if p["required"]}
    whole = path.replace("{terrain}", "hills")
    for p in parameters_of(item["get"]):
        if p["in"] == "path" and p["name"] != "terrain":
            whole = whole.replace("{%s}" % p["name"], str(p["example"]))
    answer = ask(whole, dict(needed, bbox=BOX) if "bbox" in named else needed)
    equal("OpenAPI: %s answers its examples" % path, answer.status, 200)
    kinds = item["get"]["responses"]["200"]["content"]
    check("OpenAPI: %s answers in a described type" % path, any((answer.content_type or "").startswith(kind) for kind in kinds), answer.content_type)
    described = {name.lower() for name in item["get"]["responses"]["200"].get("headers", {})} - {"etag"}
    check("OpenAPI: %s describes the headers that tell of a mesh" % path, set(told(answer)) <= described and (path.endswith(("/range", "/view")) == bool(described)),
          (told(answer), described))
    equal("OpenAPI: %s knows no other parameter" % path, ask(whole, dict(needed, another=1)).status, 400)
    for name in needed:
        left = {key: value for key, value in needed.items() if key != name}
        check("OpenAPI: %s needs %s" % (path, name), "%s" % name in ask(whole, left).detail())
    sentence = ask(whole, {"another": 1}).detail()
    takes = sorted(sentence.split("it takes")[-1].replace("none", "").split()) if "takes" in sentence else []
    if "takes" in sentence:
        equal("OpenAPI: %s describes all that it takes" % path, sorted(named), takes)
f_enum = api["components"]["parameters"]["f"]["schema"]["enum"]
sentence = ask(HILLS + "/range?eps=1&f=nothing").detail()
equal("OpenAPI: the formats are those that there are", sorted(f_enum), sorted(sentence.split("there are")[-1].split()))

# ------------------------------------------------------------------------------------------------------ negotiation
def coding(header):
    return ask(HILLS + "/range", {"wkt": WKT, "eps": 20, "f": "obj"}, headers={"Accept-Encoding": header} if header is not None else {})


whole = sql_bytes("SELECT rqt_mesh(?1, 20, 'obj', 'hills')", WKT)
for header, expected in ((None, None), ("gzip", "gzip"), ("zstd", "zstd"), ("gzip, zstd", "zstd"), ("gzip;q=1, zstd;q=0.5", "gzip"), ("gzip;q=0", None),
                         ("*", "zstd"), ("zstd;q=0, *", "gzip"), ("identity, gzip;q=0.5", None), ("br", None), ("GZIP ; Q=0.8", "gzip"), ("", None),
                         ("gzip;q=0.001", "gzip"), ("*;q=0, identity", None), ("identity;q=0, gzip", "gzip"), (";;;,,,q=,", None)):
    answer = coding(header)
    body = answer.body
    if answer.content_encoding == "gzip":
        body = gzip.decompress(body)
    elif answer.content_encoding == "zstd":
        with open(s.temp("body.zst"), "wb") as f:
            f.write(body)
        found = subprocess.run(["zstd", "-dcq", s.temp("body.zst")], capture_output=True) if shutil.which("zstd") else None
        body = found.stdout if found else whole
        check("zstd's magic", answer.body[:4] == b"\x28\xb5\x2f\xfd")
    equal("Accept-Encoding %r" % header, (answer.status, answer.content_encoding, body == whole), (200, expected, True))
    check("and fewer bytes when it is packed (%r)" % header, (len(answer.body) < len(whole) / 2) == (expected is not None))
    equal("Vary says so (%r)" % header, answer.vary, "Accept-Encoding")
equal("nothing is acceptable", coding("identity;q=0, *;q=0").status, 406)
answer = ask(HILLS + "/range", {"wkt": WKT, "eps": 20, "f": "rqt"}, headers={"Accept-Encoding": "gzip, zstd"})
equal("the wire format is packed already", (answer.content_encoding, answer.vary), (None, None))
for header, expected in (("model/obj", "model/obj"), ("model/*", "model/gltf-binary"), ("application/geo+json, application/json;q=0.9", "application/geo+json"),
                         ("text/html, */*;q=0.1", "application/json"), ("application/json;q=0.2, model/obj;q=0.3", "model/obj"),
                         ("application/json;q=0, */*", "application/geo+json"), ("application/json;version=1", "application/json")):
    answer = ask(HILLS + "/range", {"wkt": WKT, "eps": 20}, headers={"Accept": header})
    equal("Accept %s" % header, (answer.status, answer.content_type, answer.vary.split(", ")[0]), (200, expected, "Accept"))
equal("Accept image/webp: 406", ask(HILLS + "/range", {"eps": 20}, headers={"Accept": "image/webp"}).status, 406)

# ----------------------------------------------------------------------------------------------- tags, caching, CORS
RANGE = dict(wkt=WKT, eps=20, f="obj")
first = ask(HILLS + "/range", RANGE)
check("an ETag, strong", re.fullmatch(r'"[0-9a-f-]+"', first.etag or ""), first.etag)
equal("caches may keep the answer and have to ask", first.cache_control, "public, no-cache")
for header in (first.etag, "W/" + first.etag, '"x", %s' % first.etag, "*", '"x" ,W/%s' % first.etag):
    answer = ask(HILLS + "/range", RANGE, headers={"If-None-Match": header})
    equal("If-None-Match %s" % header.replace(first.etag, "ETAG"), (answer.status, answer.body, answer.etag, answer.cache_control, answer.vary, answer.access_control_allow_origin),
          (304, b"", first.etag, "public, no-cache", "Accept-Encoding", "*"))
    equal("which tells nothing of the mesh (%s)" % header.replace(first.etag, "ETAG"), told(answer), {})
for header in ('"x"', first.etag[:-2] + '"', first.etag.strip('"'), '"' + first.etag, "W/", ","):
    equal("If-None-Match %s is another" % header.replace(first.etag, "ETAG"), ask(HILLS + "/range", RANGE, headers={"If-None-Match": header}).status, 200)
tags = [first.etag, coding("gzip").etag, coding("zstd").etag, ask(HILLS + "/range", dict(RANGE, eps=21)).etag, ask(HILLS + "/range", dict(RANGE, f="ply")).etag,
        ask("/collections/plain").etag, ask(HILLS).etag, ask("/collections").etag, ask("/").etag, ask("/", headers={"Accept": "text/html"}).etag]
equal("each coding, request and document has a tag of its own", len(set(tags)), len(tags))
equal("a tag stays", ask(HILLS + "/range", RANGE).etag, first.etag)
equal("what is packed is known by its tag, too", ask(HILLS + "/range", RANGE, headers={"If-None-Match": coding("gzip").etag, "Accept-Encoding": "gzip"}).status, 304)
answer = ask(HILLS + "/range", dict(RANGE, eps=-1), headers={"If-None-Match": first.etag})
equal("an error has no tag and is kept by nobody", (answer.status, answer.etag, answer.cache_control), (400, None, "no-store"))

for path in (HILLS, HILLS + "/range?eps=50&f=obj", "/", "/collections", "/openapi.json", "/healthz", "/nothing", HILLS + "/range?eps=-1"):
    whole_answer, head = ask(path), ask(path, method="HEAD")
    equal("HEAD %s" % path, (head.status, head.body, head.content_length, head.content_type, head.etag),
          (whole_answer.status, b"", whole_answer.content_length, whole_answer.content_type, whole_answer.etag))
    equal("HEAD %s tells what GET does" % path, told(head), told(whole_answer))
for path in (HILLS + "/range", "/", "*"):
    answer = ask(path, method="OPTIONS", headers={"Origin": "http://elsewhere.example", "Access-Control-Request-Method": "GET"})
    equal("OPTIONS %s" % path, (answer.status, answer.allow, answer.access_control_allow_methods, answer.access_control_allow_origin, answer.body),
          (204, "GET, HEAD, OPTIONS", "GET, HEAD, OPTIONS", "*", b""))
exposed = {name.strip().lower() for name in (ask(HILLS + "/range?eps=400&f=rqt").access_control_expose_headers or "").split(",")}
equal("pages from elsewhere may read the tag and what is told", exposed, {"etag", *TOLD.values()})
for path in (HILLS, "/nothing", HILLS + "/range?eps=-1"):
    equal("CORS of %s" % path, ask(path, headers={"Origin": "http://elsewhere.example"}).access_control_allow_origin, "*")
for method in ("POST", "PUT", "DELETE", "PATCH", "TRACE", "PROPFIND", "BREW"):
    answer = ask(HILLS, method=method)
    equal("%s is not answered" % method, (answer.status, answer.allow), (405, "GET, HEAD, OPTIONS"))
    service.connection.close()
equal("POST with a body neither", ask(HILLS, method="POST", body=b"a=b").status, 405)
service.connection.close()
equal("nor GET with one", ask(HILLS, body=b"a=b").status, 400)
service.connection.close()


def answers_to(head):
    """How the service takes what a server before it may have taken for one request with a body: the statuses."""
    raw = socket.create_connection(("127.0.0.1", service.port), timeout=60)
    raw.sendall(b"GET /healthz HTTP/1.1\r\nHost: a\r\n" + head + b"\r\nGET /conformance HTTP/1.1\r\nHost: b\r\nConnection: close\r\n\r\n")
    received = b"".join(iter(lambda: raw.recv(65536), b""))
    raw.close()
    return [int(status) for status in re.findall(rb"HTTP/1\.1 (\d{3}) ", received)]


equal("two requests are two", answers_to(b"Content-Length: 0\r\n"), [200, 200])
for head in (b"Content-Length: 0\r\nContent-Length: 60\r\n", b"Content-Length: 60\r\nContent-Length: 0\r\n", b"Content-Length : 60\r\n", b"Transfer-Encoding : chunked\r\n",
             b"Content-Length: 0\r\nTransfer-Encoding: chunked\r\n"):
    equal("no request hides in another's body (%s)" % head.decode().strip().replace("\r\n", ", "), answers_to(head), [400])

connection = service.connect()
answers = [ask(HILLS + "/height?x=-71.3&y=44.2", connection=connection).status for _ in range(3)]
sock = connection.sock
equal("one connection serves many requests", (answers, connection.sock is sock and sock is not None), ([200] * 3, True))
connection.close()

# ----------------------------------------------------------------------------------------------------------- errors
for path, status, sentence in (
        ("/nothing", 404, "there is nothing at this path"),
        ("/collections/", 404, "there is no terrain of this name"),
        ("/collections/nobody", 404, "there is no terrain of this name"),
        ("/collections/nobody/range?eps=1", 404, "there is no terrain of this name"),
        ("/collections/hills/range/more", 404, "there is nothing at this path"),
        ("/collections/hills/a/b/c/d/e/f/g", 404, "so many parts"),
        ("/collections/main.hills", 404, "there is no terrain of this name"),
        ("//collections", 404, "there is nothing at this path"),
        (HILLS + "/range", 400, "the parameter eps of /collections/{terrain}/range is missing"),
        (HILLS + "/range?eps=", 400, "the parameter eps must be a number"),
        (HILLS + "/range?eps=nan", 400, "the parameter eps must be a number"),
        (HILLS + "/range?eps=0x10", 400, "the parameter eps must be a number"),
        (HILLS + "/range?eps=1e", 400, "the parameter eps must be a number"),
        (HILLS + "/range?eps=-1", 400, "rqt_range(): eps must be 0 or more; it is -1.0"),
        (HILLS + "/range?eps=1&eps=2", 400, "the parameter eps is given twice"),
        (HILLS + "/range?eps=1&size=2", 400, 'takes no parameter "size"'),
        (HILLS + "/range?eps=1&=2", 400, 'takes no parameter ""'),
        (HILLS + "/range?eps=1&eps!=2", 400, 'takes no parameter "eps!"'),
        (HILLS + "/range?eps=1&f=dwg", 400, 'there is no format "dwg"'),
        (HILLS + "/range?eps=1&bbox=1,2,3", 400, "bbox must be four numbers"),
        (HILLS + "/range?eps=1&bbox=1,2,3,4,5", 400, "bbox must be four numbers"),
        (HILLS + "/range?eps=1&bbox=1,2,3,9e999", 400, "bbox must be four numbers"),
        (HILLS + "/range?eps=1&bbox=1,2,3,4&wkt=POINT(1%202)", 400, "two regions"),
        (HILLS + "/range?eps=1&wkt=POINT(1", 400, "rqt_range(): "),
        (HILLS + "/range?eps=1&wkt=", 400, "rqt_range(): "),
        (HILLS + "/range?eps=1&options=%7B", 400, "rqt_range(): options are not JSON"),
        (HILLS + "/range?eps=1&options=[]", 400, "rqt_range(): options must be a JSON object"),
        (HILLS + "/range?eps=1&options=[]&mode=cut", 400, "the parameter options must be a JSON object"),
        (HILLS + "/range?eps=1&options=%7B%22mode%22:%22cut%22%7D&mode=cut", 400, "the option mode is given in options and on its own"),
        (HILLS + "/range?eps=1&mode=upside", 400, 'option "mode" has no value "upside"'),
        (HILLS + "/range?eps=1&max_vertices=many", 400, 'option "max_vertices"'),
        (HILLS + "/range?eps=20&max_vertices=3", 400, 'option "max_vertices"'),
        (HILLS + "/height?x=1", 400, "the parameter y of"),
        (HILLS + "/height?x=1&y=b", 400, "the parameter y must be a number"),
        (HILLS + "/view?camera=%7B%7D", 400, "rqt_view(): "),
        (HILLS + "/profile?line=POLYGON((0 0,1 1,0 1,0 0))".replace(" ", "%20"), 400, "rqt_profile(): "),
        (HILLS + "/range?eps=1&wkt=%FF", 400, "the query is no UTF-8"),
        (HILLS + "/range?eps=1&wkt=%C0%80", 400, "the query is no UTF-8"),
        (HILLS + "/range?eps=1&wkt=%ED%A0%80", 400, "the query is no UTF-8"),
        (HILLS + "/range?eps=1&wkt=a%00b", 400, "the query holds a NUL"),
        (HILLS + "/range?eps=1&wkt=%4", 400, "the query holds a % that two hexadecimal digits do not follow"),
        ("/collections/%zz", 400, "the path holds a %"),
        ("/collections/a%00b", 400, "the path holds a NUL"),
        (HILLS + "?a=1&" + "&".join("b%d=1" % i for i in range(40)), 400, "more than 32 parameters"),
        ("http://elsewhere.example", 400, "the path is missing"),
        ("http://elsewhere.example?f=json", 400, "does not begin with /"),
        ("/?f=pdf", 400, "json or html"),
        ("/" + "a" * 33000, 414, "longer than 32768 bytes")):
    answer = ask(path)
    check("%.70s: %d" % (path, status), answer.status == status and sentence in answer.detail(), (answer.status, answer.body))
check("an escaped / is part of a name", ask("/collections%2Fhills").status == 404)
equal("names may be escaped all the same", ask("/%63ollections/h%69lls").json(), hills)
equal("an absolute target, as proxies send it", ask("http://elsewhere.example" + HILLS).json(), hills)

health = ask("/healthz")
equal("/healthz", (health.status, health.json(), health.cache_control), (200, {"status": "ok"}, "no-store"))
metrics = ask("/metrics")
text = metrics.body.decode()
equal("/metrics is Prometheus's format", metrics.content_type, "text/plain; version=0.0.4; charset=utf-8")
check("every line of it", all(re.fullmatch(r"# (HELP|TYPE) \w+ .+|\w+(\{\w+=\"[^\"]*\"(,\w+=\"[^\"]*\")*\})? [0-9.e+-]+", line) for line in text.splitlines()),
      [line for line in text.splitlines() if not re.fullmatch(r"# (HELP|TYPE) \w+ .+|\w+(\{\w+=\"[^\"]*\"(,\w+=\"[^\"]*\")*\})? [0-9.e+-]+", line)])
counted = int(re.search(r'rqt_requests_total\{endpoint="delta",code="200"\} (\d+)', text).group(1))
check("requests are counted", counted >= 1 and 'endpoint="other",code="404"' in text and 'rqt_request_seconds_bucket{endpoint="range",le="+Inf"}' in text)

# -------------------------------------------------------------------------------------------------------------- its end
status, said = service.stop()
equal("SIGTERM ends it, with 0 and nothing to say", (status, said), (0, ""))

# Slow enough to be under way when the signal comes: all of the terrain, verified at eps 0.
service = Service(DB, "--max-triangles", "100000000", "--max-samples", "100000000", "--max-seconds", "100")
slow = {}


def ask_slowly(key, path):
    slow[key] = service.ask(path, connection=service.connect())


thread = threading.Thread(target=ask_slowly, args=("verify", HILLS + "/verify?eps=0"))
thread.start()
wait_until(lambda: b"rqt_requests_working 1" in service.ask("/metrics").body)
service.process.send_signal(signal.SIGINT)
thread.join()
equal("what is under way at SIGINT is answered", (slow["verify"].status, slow["verify"].json().get("max_error")), (200, 0))
equal("and its connection is told that it was the last", slow["verify"].connection, "close")
equal("then it ends", service.stop()[0], 0)
try:
    service.ask("/healthz", connection=service.connect())
    check("nobody listens any more", False)
except OSError:
    check("nobody listens any more", True)

# ------------------------------------------------------------------------------------------------------------ limits
service = Service(DB, "--max-triangles", "1000", "--max-samples", "20000", "--max-bytes", "40000", "--max-seconds", "1000", "--max-age", "60")
ask = service.ask
for path, status, sentence in (("/range?eps=0&f=obj", 413, "rqt_answer(): the mesh has more than 1000 triangles"),
                               ("/range?eps=0", 413, "rqt_range(): the mesh has more than 1000 triangles"),
                               ("/range?eps=0&f=strip", 413, "rqt_answer(): the mesh has more than 1000 triangles"),
                               ("/range?eps=0&f=rqt", 413, "rqt_answer(): the mesh has more than 1000 triangles"),
                               ("/range?eps=1&f=obj&mode=cut&bbox=" + BOX, 413, "rqt_answer(): the mesh has more than 1000 triangles"),
                               ("/explain?eps=0", 413, "rqt_explain(): the mesh has more than 1000 triangles"),
                               ("/verify?eps=400", 413, "rqt_verify(): there are more than 20000 samples"),
                               ("/area?eps=0", 413, "rqt_area(): the mesh has more than 1000 triangles"),
                               ("/range?eps=400&f=geojson", 413, "the answer is larger than 40000 bytes"),
                               ("/view?f=ply&camera=" + CAMERA.replace('"tau": 3', '"tau": 0.5').replace(" ", "").replace('"', "%22").replace("{", "%7B").replace("}", "%7D"), 413,
                                "rqt_view_answer(): the mesh has more than 1000 triangles")):
    answer = ask(HILLS + path)
    check("%.40s: %d" % (path, status), answer.status == status and sentence in answer.detail(), (answer.status, answer.body[:200]))
check("a budget above the limit is still bounded", ask(HILLS + "/range?eps=0&f=obj&max_vertices=100000").status == 413)
equal("and one below it answers", ask(HILLS + "/range?eps=0&f=rqt&max_vertices=300").status, 200)
equal("--max-age", ask(HILLS).cache_control, "public, max-age=60")
equal("it ends", service.stop(), (0, ""))

# A hundredth of a second is too short for the minimal errors of 1.4 million samples, on any machine.
service = Service(DB, "--max-seconds", "0.01")
answer = service.ask(HILLS + "/range?metric=minimal&eps=400&f=obj")
check("what takes too long is stopped", answer.status == 503 and "takes longer than 0.01 s" in answer.detail() and answer.retry_after == "1", (answer.status, answer.body[:200]))
check("and what does not is answered", wait_until(lambda: service.ask(HILLS + "/range?eps=400&f=obj").body == sql_bytes("SELECT rqt_mesh(NULL, 400, 'obj', 'hills')")))
equal("it ends", service.stop(), (0, ""))

# ------------------------------------------------------------------------------------------ databases that change
one, other = s.temp("one.gpkg"), s.temp("other.gpkg")
shutil.copy(DB, one)
s.import_terrain(other, flat, name="plain", nodata=-9999)
higher = s.write_grid(s.temp("higher.asc"), [[z if z is None else z + 5 for z in row] for row in s.rough_grid(130, 97, 7, voids=20)], x0=1000, y0=2000, cell=25)
part = s.write_grid(s.temp("part.asc"), [[500] * 5] * 5, x0=1000 + 25 * 10, y0=2000 + 25 * 10, cell=25)
service = Service(one, "--workers", "2")
ask = service.ask
PLAIN = "/collections/plain/range?eps=1&f=obj"


def sql_of(path):
    fresh = s.connect(path)
    value = s.one(fresh, "SELECT rqt_mesh(NULL, 1, 'obj', 'plain')").encode()
    fresh.close()
    return value


def all_workers(path):
    """What many at once are told: every worker answers."""
    answers = []

    def run():
        answers.append(service.ask(path, connection=service.connect()))

    threads = [threading.Thread(target=run) for _ in range(8)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    return {(a.status, a.etag, a.body) for a in answers}


before = all_workers(PLAIN)
equal("all workers give one answer under one tag", before, {(200, list(before)[0][1], sql_of(one))})
tag = list(before)[0][1]
said, status = s.run([s.RQT, "update", "--terrain", "plain", part, one])
equal("(an update)", status, 0)
after = all_workers(PLAIN)
new_tag = list(after)[0][1]
equal("after an update all give the new one", after, {(200, new_tag, sql_of(one))})
check("under another tag", new_tag != tag and list(after)[0][2] != list(before)[0][2])
equal("and the old tag is not true any more", ask(PLAIN, headers={"If-None-Match": tag}).status, 200)
tag = ask("/collections/plain").etag
before_stat = os.stat(one)
touch = s.connect(one)
touch.execute("UPDATE rqt_terrain SET created = 'lately' WHERE name = 'plain'")
touch.close()
os.utime(one, ns=(before_stat.st_atime_ns, before_stat.st_mtime_ns))
equal("(a commit, and the file's size and time are what they were)", os.stat(one)[6:9:2], before_stat[6:9:2])
answer = ask("/collections/plain")
check("a commit is seen, whatever the file's times say", answer.json()["terrain"]["created"] == "lately" and answer.etag not in (tag, None), answer.headers)

# Two files of one size, one change counter and one time, written over each other.
with open(one, "rb") as file:
    original = file.read()
variants = []
for created in ("earlier", "to-day."):
    path = s.temp("variant.gpkg")
    with open(path, "wb") as file:
        file.write(original)
    touch = s.connect(path)
    touch.execute("UPDATE rqt_terrain SET created = ? WHERE name = 'plain'", (created,))
    touch.close()
    with open(path, "rb") as file:
        variants.append(file.read())
equal("(variants differ, but not in size and counter)", [len(v) for v in variants] + [v[24:28] for v in variants], [len(original)] * 2 + [variants[0][24:28]] * 2)
tags = []
for variant in variants:
    with open(one, "r+b") as file:
        file.write(variant)
    os.utime(one, ns=(before_stat.st_atime_ns, before_stat.st_mtime_ns))
    tags.append(ask("/collections/plain").etag)
check("a file that is written over, its time set back, has another tag", tags[0] != tags[1] and None not in tags, tags)
s.import_terrain(one, higher, name="plain", nodata=-9999, replace=True)
equal("after an import in its place", {(a[0], a[2]) for a in all_workers(PLAIN)}, {(200, sql_of(one))})

os.rename(one, s.temp("away.gpkg"))
answer = ask("/collections/plain")
check("a database that is gone: 500", answer.status == 500 and "one.gpkg: No such file" in answer.detail(), (answer.status, answer.body))
check("which tells no folder", s.TEMP not in answer.detail(), answer.detail())
equal("the service lives", ask("/healthz").status, 200)
shutil.copy(other, s.temp("next.gpkg"))
os.rename(s.temp("next.gpkg"), one)
equal("another database in its place is served", {(a[0], a[2]) for a in all_workers(PLAIN)}, {(200, sql_of(other))})
equal("and what it lacks is not", ask(HILLS).status, 404)
shutil.copyfile(s.temp("away.gpkg"), one)  # into the same file
equal("one that is overwritten, too", {(a[0], a[2]) for a in all_workers(PLAIN)}, {(200, sql_of(s.temp("away.gpkg")))})

# damage: a block's bytes, the file's pages, no database at all
pristine = s.temp("away.gpkg")
for what, harm in (("a block", "block"), ("pages", "pages"), ("text", "text"), ("nothing", "empty"), ("half", "half")):
    shutil.copy(pristine, s.temp("harmed.gpkg"))
    if harm == "block":
        raw = s.connect(s.temp("harmed.gpkg"))
        number = s.one(raw, "SELECT id FROM rqt_terrain WHERE name = 'plain'")
        for table_row in raw.execute("SELECT id, data FROM rqt_block_%d" % number).fetchall():
            data = bytearray(table_row[1])
            if len(data) > 30:
                data[len(data) // 2] ^= 0x55
            raw.execute("UPDATE rqt_block_%d SET data = ?1 WHERE id = ?2" % number, (bytes(data), table_row[0]))
        raw.close()
    elif harm == "pages":
        with open(s.temp("harmed.gpkg"), "r+b") as f:
            f.seek(4096)
            f.write(b"\xa5" * (os.path.getsize(s.temp("harmed.gpkg")) - 4096))
    elif harm == "half":
        os.truncate(s.temp("harmed.gpkg"), os.path.getsize(s.temp("harmed.gpkg")) // 2 + 1000)
    else:
        with open(s.temp("harmed.gpkg"), "wb") as f:
            f.write(b"" if harm == "empty" else b"this is no database at all, but it is long enough to be one" * 100)
    os.rename(s.temp("harmed.gpkg"), one)
    answer = ask("/collections/plain/range?eps=0&f=obj")
    if harm == "empty":
        equal("an empty file has no terrain", answer.status, 404)
    else:
        check("damage to %s: 500 with a sentence" % what, answer.status == 500 and len(answer.detail()) > 10 and "no problem" not in answer.detail(), (answer.status, answer.body[:300]))
        answer = ask("/collections")
        check("and /collections says so, where there is no other (%s)" % what, answer.status in (200, 500) and (answer.status == 200 or len(answer.detail()) > 10), (answer.status, answer.body[-200:]))
    equal("the service lives (%s)" % what, (ask("/healthz").status, ask("/").status), (200, 200))
shutil.copy(pristine, s.temp("next.gpkg"))
os.rename(s.temp("next.gpkg"), one)
equal("healed, it answers again", {(a[0], a[2]) for a in all_workers(PLAIN)}, {(200, sql_of(pristine))})
incomplete = s.connect(one)
incomplete.execute("UPDATE rqt_terrain SET complete = 0 WHERE name = 'plain'")
incomplete.close()
answer = ask(PLAIN)
check("an import that has not finished: 503", answer.status == 503 and "has not finished" in answer.detail(), (answer.status, answer.body))
equal("it is no collection yet", [c["id"] for c in ask("/collections").json()["collections"]], ["hills"])
equal("it ends", service.stop(), (0, ""))

# WAL, where a file may stay as it is while what it holds changes
walled = s.temp("walled.gpkg")
shutil.copy(DB, walled)
wal = s.connect(walled)
equal("(WAL)", s.one(wal, "PRAGMA journal_mode = WAL"), "wal")
wal.execute("PRAGMA wal_autocheckpoint = 0")
wal.execute("UPDATE rqt_terrain SET created = 'before' WHERE name = 'plain'")
service = Service(walled)
ask = service.ask
seen = []
for step in range(4):
    answer = ask("/collections/plain")
    equal("WAL: a commit is seen (%d)" % step, answer.json()["terrain"]["created"], "step %d" % step if step else "before")
    equal("WAL: and stays, for all workers (%d)" % step, {a[1] for a in all_workers("/collections/plain")}, {answer.etag})
    seen.append(answer.etag)
    if step == 2:
        wal.execute("PRAGMA wal_checkpoint(FULL)")
        equal("WAL: a checkpoint changes nothing that is told", ask("/collections/plain").body, answer.body)
    wal.execute("UPDATE rqt_terrain SET created = ?1 WHERE name = 'plain'", ("step %d" % (step + 1),))
check("WAL: each commit has its tag", len(set(seen)) == 4 and None not in seen, seen)
equal("it ends", service.stop(), (0, ""))
wal.close()

# ----------------------------------------------------------------------------------------------------- several databases
shutil.copy(other, s.temp("second.gpkg"))
shutil.copy(pristine, one)
service = Service(other, one)
ask = service.ask
equal("terrains of all databases, of one name the first one's", sorted(c["id"] for c in ask("/collections").json()["collections"]), ["hills", "plain"])
equal("the first one's", ask(PLAIN).body, sql_of(other))
equal("and another's", ask(HILLS + "/range?eps=100&f=obj").body, sql_bytes("SELECT rqt_mesh(NULL, 100, 'obj', 'hills')"))
with open(s.temp("junk"), "wb") as f:
    f.write(b"junk" * 5000)
os.rename(s.temp("junk"), other)
answer = ask("/collections")
equal("one that is damaged does not hide the other", [c["id"] for c in answer.json().get("collections", [])], ["hills", "plain"])
problems = answer.json().get("problems", [])
check("but is named", [p["database"] for p in problems] == ["other.gpkg"] and "not a database" in problems[0]["detail"], answer.body[-300:])
equal("what the other has is answered", ask(PLAIN).body, sql_of(one))
equal("what neither has may be in the damaged one", ask("/collections/nobody").status, 500)
equal("it ends", service.stop(), (0, ""))

# a region whose edges are all in every row: each sample takes its time
zigzag = "POLYGON((%s,-71.5 44.01,-71.99 44.01))" % ",".join("%.4f %s" % (-71.99 + 0.98 * i / 1000, "44.99" if i % 2 else "44.01") for i in range(1001))
service = Service(DB, "--max-seconds", "1")
equal("a proof ends with its time", service.ask(HILLS + "/verify", {"eps": 1000, "wkt": zigzag}).status, 503)
equal("it ends", service.stop(), (0, ""))

# --------------------------------------------------------------------------------------------------- hostile databases
hostile = s.temp("hostile.gpkg")
shutil.copy(pristine, hostile)
harm = s.connect(hostile)
harm.execute("UPDATE rqt_terrain SET crs = CAST(x'ff222241c0af' AS TEXT) WHERE name = 'plain'")
harm.close()
service = Service(hostile)
equal("text that is no UTF-8 is marked", service.ask("/collections/plain").json()["terrain"]["crs"], '\ufffd""A\ufffd\ufffd')
equal("it ends", service.stop(), (0, ""))
shutil.copy(pristine, hostile)
harm = s.connect(hostile)
harm.execute("CREATE VIEW rqt_terrains AS SELECT NULL AS name, 'main' AS schema, 1 AS complete, %s FROM (VALUES (1), (2))" %
             ", ".join("1 AS " + c for c in ("srid width height x0 y0 dx dy cell_x cell_y min_z max_z quantum quantum_error voids blocks bytes max_error k crs crs_name "
                                             "lonlat metre semi_major inverse_flattening vertical created").split()))
harm.close()
service = Service(hostile)
equal("terrains without a name are none", service.ask("/collections").json().get("collections"), [])
equal("it ends", service.stop(), (0, ""))

# ---------------------------------------------------------------------------------------- answers that nobody takes
service = Service(DB, "--memory", "256", "--max-seconds", "1000")
size = len(sql_bytes("SELECT rqt_mesh(NULL, 12, 'ply', 'hills')"))
crowd = []
for _ in range(2 + (256 << 20) // size):
    lazy = socket.socket()
    lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    lazy.settimeout(60)
    lazy.connect(("127.0.0.1", service.port))
    lazy.sendall(("GET %s/range?eps=12&f=ply HTTP/1.1\r\nHost: a\r\n\r\n" % HILLS).encode())
    crowd.append(lazy)
begun = [lazy.recv(1500) for lazy in crowd]
sent, refused = (sum(words in answer for answer in begun) for words in (b" 200 ", b"answers on their way"))
check("answers on their way take no more memory than they may", size > 2 << 20 and refused > 0 and sent * size <= 256 << 20, (size, sent, refused))
equal("small ones are answered", service.ask(HILLS).status, 200)
for lazy in crowd:
    lazy.close()
check("and large ones when those are gone", wait_until(lambda: service.ask(HILLS + "/range?eps=12&f=ply").status == 200))
equal("it ends", service.stop(), (0, ""))

# ------------------------------------------------------------------------------------------------------- the command
for arguments, status, sentence in (([], 2, "a database is missing"), (["--port", "99999", DB], 2, "--port 99999"), (["--port", "0", s.temp("none")], 1, "No such file"),
                                    (["--port", "0", flat], 1, "is not an SQLite database"), (["--bind", "localhost!", DB], 1, "is no numeric address"),
                                    (["--bind", "192.0.2.1", DB], 1, "Cannot assign"), (["--workers", "0", DB], 2, "--workers 0"), (["--max-seconds", "-1", DB], 2, "seconds from")):
    said, code = s.run([s.RQT, "serve", *arguments])
    check("rqt serve %s" % " ".join(a.replace(s.TEMP + "/", "") for a in arguments), code == status and sentence in said, (code, said))
busy = socket.socket()
busy.bind(("127.0.0.1", 0))
busy.listen()
said, code = s.run([s.RQT, "serve", "--port", str(busy.getsockname()[1]), DB])
check("a port that is taken", code == 1 and "Address already in use (--port 0 takes one that is free)" in said, (code, said))
busy.close()
service = Service("--bind", "::1", DB)
check("IPv6", re.fullmatch(r"http://\[::1\]:\d+/", service.url), service.url)
service.stop()

s.finish()
