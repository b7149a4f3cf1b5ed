"""Tiles for globes as files: `rqt tiles` killed, told to go on, and given folders that are not its own; and the same tiles
of the service."""
import fcntl
import gzip
import json
import os
import shutil
import signal
import subprocess
import time

import serve_support as service
import sql_support as s
from tiles_support import Tile, coast, files, listed, pyramid, told_by, window

COAST, _ = coast()
ALPS = pyramid("alps", window("alps", "glarus_1arc_native_161.tif", 30, 40, 85, 73))

# ------------------------------------------------------------------------------------------------------------ to disk

whole = files(COAST.folder)
again = s.temp("again")
command = [s.RQT, "tiles", COAST.database, "-o", again]
process = subprocess.Popen(command + ["--jobs", "1"])
while process.poll() is None and sum(len(names) for _, _, names in os.walk(again)) < 12:
    time.sleep(0.001)
process.send_signal(signal.SIGKILL)
process.wait()
killed = {path: data for path, data in files(again).items() if path.endswith(".terrain")}
s.check("killed, it leaves whole tiles and no layer.json (%d of %d)" % (len(killed), len(whole)),
        0 < len(killed) < len(whole) - 2 and all(whole[path] == data for path, data in killed.items()) and not os.path.exists(again + "/layer.json"),
        len(killed))
kept, emptied = sorted(killed)[0], sorted(killed)[-1]
os.truncate(os.path.join(again, emptied), 0) # as a cut of power may leave it
before = os.stat(os.path.join(again, kept)).st_ino
s.equal("the same command goes on there", s.run(command + ["--jobs", "2"]), ("", 0))
s.equal("... and the folder is that of one that was not killed, byte for byte", files(again), whole)
s.equal("... without making again what was there", os.stat(os.path.join(again, kept)).st_ino, before)
with open(again + "/.rqt-tiles", "rb") as held:
    fcntl.flock(held, fcntl.LOCK_EX)
    out, status = s.run(command)
s.check("... by one command at a time", status == 1 and "another rqt tiles is at work there" in out, out)
out, status = s.run([s.RQT, "tiles", ALPS.database, "-o", again])
s.check("tiles of another terrain are not mixed in", status == 1 and "holds tiles of another terrain" in out, out)
out, status = s.run(command + ["--gzip"])
s.check("... nor compressed ones", status == 1 and "holds tiles of another terrain" in out, out)
os.remove(os.path.join(again, ".rqt-tiles"))
out, status = s.run(command)
s.check("... nor into a folder that says nothing of its files", status == 1 and "holds files that are not of rqt tiles" in out and not os.path.exists(again + "/.rqt-tiles"), out)
packed = s.temp("packed")
s.equal("--gzip", s.run([s.RQT, "tiles", COAST.database, "-o", packed, "--gzip", "--levels", "3-9"]), ("", 0))
s.equal("... has the same tiles, compressed", {path: gzip.decompress(data) for path, data in files(packed).items() if path.endswith(".terrain")},
        {path: data for path, data in whole.items() if path.endswith(".terrain") and 3 <= int(path.split("/")[0]) <= 9})
with open(packed + "/layer.json", encoding="utf-8") as f:
    some = json.load(f)
s.equal("... and a layer.json of the levels asked for", (some["minzoom"], some["maxzoom"], some["available"][2], some["available"][3:10]),
        (3, 9, [], COAST.layer["available"][3:10]))
top = s.temp("top")
s.equal("--levels 0-4", s.run([s.RQT, "tiles", COAST.database, "-o", top, "--levels", "0-4"]), ("", 0))
roots = {x: Tile(0, x, 0, files(top)["0/%d/0.terrain" % x]) for x in (0, 1)}
s.equal("... has tiles of level 0 that tell of no others than there are", sorted(told_by(roots)), sorted(k for k in COAST.tiles if 0 < k[0] <= 4))
flat = s.temp("flat.gpkg")
s.import_terrain(flat, s.write_grid(s.temp("flat.asc"), s.rough_grid(9, 9, 1)), name="flat")
for arguments, sentence, expected in (
        ([flat, "-o", s.temp("none")], "terrain flat has no tiles: they are of terrains in longitude and latitude on WGS 84", 1),
        ([COAST.database], "-o FOLDER is missing", 2),
        ([COAST.database, "-o", s.temp("none"), "--levels", "9-3"], "--levels 9-3: two levels", 2),
        ([COAST.database, "-o", s.temp("none"), "--levels", "24"], "terrain coast has levels 0 to 12", 1),
        ([COAST.database, "-o", s.temp("none"), "--terrain", "nowhere"], "nowhere", 1),
        ([COAST.database, "-o", COAST.database], "Not a directory", 1)):
    out, status = s.run([s.RQT, "tiles", *arguments])
    s.check("rqt tiles %s: %s" % (" ".join(os.path.basename(a) for a in arguments), sentence), sentence in out and status == expected, out)

# A database that somebody has edited.
for name, edit, sentence in (("fill", "UPDATE rqt_fill_1 SET row = 100000 WHERE id = (SELECT max(id) FROM rqt_fill_1)", "terrain coast is damaged: its filled samples"),
                             ("block", "UPDATE rqt_block_1 SET data = zeroblob(length(data))", "damaged")):
    edited = s.temp(name + ".edited.gpkg")
    shutil.copy(COAST.database, edited)
    db = s.connect(edited)
    db.execute(edit)
    db.close()
    folder = s.temp(name + ".edited")
    out, status = s.run([s.RQT, "tiles", edited, "-o", folder])
    s.check("F55_an_edited_%s_is_a_sentence_and_no_layer_json" % name, status == 1 and sentence in out and not os.path.exists(folder + "/layer.json"), out)

# Places, cells and heights that are none of the Earth's: a sentence, and no folder that takes for ever.
for name, edit, kinds, sentence in (
        ("longitude", "x0 = 1e300", ("quantized-mesh", "3d-tiles", "terrarium"), "it has longitudes beyond two turns of the Earth"),
        ("turn", "x0 = -773094113099.0", ("quantized-mesh", "3d-tiles", "terrarium"), "it has longitudes beyond two turns of the Earth"),
        ("cell", "dy = dy / 1e9", ("quantized-mesh", "3d-tiles", "terrarium"), "its cells are too small or too long"),
        ("long_cell", "dy = dy / 2000", ("quantized-mesh", "3d-tiles", "terrarium"), "its cells are too small or too long"),
        ("height", "height_offset = 1e300", ("quantized-mesh",), "are none of the Earth's")):
    edited = s.temp(name + ".edited.gpkg")
    shutil.copy(COAST.database, edited)
    db = s.connect(edited)
    db.execute("UPDATE rqt_terrain SET " + edit)
    db.close()
    for kind in kinds:
        folder = s.temp("%s.%s.edited" % (name, kind))
        out, status = s.run(["timeout", "60", s.RQT, "tiles", edited, "-o", folder, "--kind", kind])
        s.check("F55_an_edited_%s_is_a_sentence: %s" % (name, kind), status == 1 and sentence in out and not os.path.exists(folder), out)

# A folder in which somebody has put links: nothing outside of it is written to, and no link passes for a tile.
linked, outside = s.temp("linked"), s.temp("outside")
with open(outside, "w", encoding="utf-8") as f:
    f.write("mine")
key = "%d/%d/%d.terrain" % max(COAST.tiles)
os.makedirs(os.path.dirname(os.path.join(linked, key)))
shutil.copy(COAST.folder + "/.rqt-tiles", linked)
os.symlink(outside, os.path.join(linked, key + ".part"))
other = "%d/%d/%d.terrain" % min(COAST.tiles)
os.makedirs(os.path.dirname(os.path.join(linked, other)), exist_ok=True)
os.symlink(outside, os.path.join(linked, other))
s.equal("links in the folder", s.run([s.RQT, "tiles", COAST.database, "-o", linked]), ("", 0))
with open(outside, encoding="utf-8") as f:
    s.equal("... are not written through", f.read(), "mine")
s.equal("... and the folder is that without them", files(linked), whole)
os.makedirs(s.temp("claimed"))
os.symlink(s.temp("claimed.elsewhere"), s.temp("claimed") + "/.rqt-tiles")
out, status = s.run([s.RQT, "tiles", COAST.database, "-o", s.temp("claimed")])
s.check("... nor made through one", status == 1 and ".rqt-tiles" in out and not os.path.exists(s.temp("claimed.elsewhere")), out)

# A database with a log: SQLite makes the log anew for whoever reads, without bytes.
logged = s.temp("logged.gpkg")
shutil.copy(COAST.database, logged)
db = s.connect(logged, load=False)
db.execute("PRAGMA journal_mode = WAL")
db.close()
for name in ("tiles of a database with a log", "... are gone on with by the same command"):
    s.equal(name, s.run([s.RQT, "tiles", logged, "-o", s.temp("logged")]), ("", 0))
# What changes the file and not the terrain: other tables, the log's end, VACUUM, a copy.
db = s.connect(logged, load=False)
db.execute("CREATE TABLE other AS SELECT 1 AS x")
for name, sql in (("beside another table", "SELECT 1"), ("after a checkpoint", "PRAGMA wal_checkpoint(TRUNCATE)"), ("after VACUUM", "VACUUM")):
    db.execute(sql).fetchall()
    s.equal("... " + name, s.run([s.RQT, "tiles", logged, "-o", s.temp("logged")]), ("", 0))
db.close()
shutil.copy(logged, s.temp("copied.gpkg"))
s.equal("... by a copy", s.run([s.RQT, "tiles", s.temp("copied.gpkg"), "-o", s.temp("logged")]), ("", 0))
for name, sql in (("row", "UPDATE rqt_terrain SET source = 'elsewhere'"), ("summary", "UPDATE rqt_block_1 SET summary = (SELECT summary FROM rqt_block_1 WHERE id > 1) WHERE id = 1"),
                  ("block", "UPDATE rqt_block_1 SET data = (SELECT data FROM rqt_block_1 WHERE id > 1) WHERE id = 1"), ("sea", "UPDATE rqt_fill_1 SET col0 = col0 + 1 WHERE id = 1")):
    shutil.copy(logged, s.temp("changed.gpkg"))
    db = s.connect(s.temp("changed.gpkg"), load=False)
    db.execute(sql)
    db.close()
    out, status = s.run([s.RQT, "tiles", s.temp("changed.gpkg"), "-o", s.temp("logged")])
    s.check("... not with another " + name, status == 1 and "of another state of it" in out, out)
db = s.connect(s.temp("changed.gpkg"), load=False)
db.execute("UPDATE rqt_block_1 SET data = 7 WHERE id = (SELECT max(id) FROM rqt_block_1)")
last = s.one(db, "SELECT max(id) FROM rqt_block_1")
db.close()
s.equal("a block that is not bytes is named", s.run([s.RQT, "tiles", s.temp("changed.gpkg"), "-o", s.temp("number")]),
        ("rqt tiles: terrain coast is damaged: block %d\n" % last, 1))

# --------------------------------------------------------------------------------------------------------- the service

server = service.Service(COAST.database, flat)
root = "/collections/coast/tiles/quantized-mesh/"
answer = server.ask(root + "layer.json")
s.equal("the service's layer.json is the command's", (answer.content_type, answer.body), ("application/json", whole["layer.json"]))
s.equal("every tile that is listed is served, with the bytes of the command",
        [key for key in listed(COAST.layer) if server.ask(root + "%d/%d/%d.terrain" % key).body != whole["%d/%d/%d.terrain" % key]], [])
key = max(COAST.tiles)
answer = server.ask(root + "%d/%d/%d.terrain" % key, headers={
    "Accept": "application/vnd.quantized-mesh;extensions=octvertexnormals-watermask-metadata,application/octet-stream;q=0.9,*/*;q=0.01",
    "Accept-Encoding": "gzip"})
s.equal("... as clients ask for it", (answer.status, answer.content_type, answer.content_encoding, gzip.decompress(answer.body)),
        (200, "application/vnd.quantized-mesh", "gzip", whole["%d/%d/%d.terrain" % key]))
s.equal("... and not again when they have it", server.ask(root + "%d/%d/%d.terrain" % key, headers={"Accept-Encoding": "gzip", "If-None-Match": answer.etag}).status, 304)
around = {(z, x + i, y + j) for z, x, y in COAST.tiles for i in (-1, 0, 1) for j in (-1, 0, 1)} - set(COAST.tiles) - set(COAST.empty)
s.equal("tiles that are not listed are not there",
        [t for t in sorted(around) if min(t) >= 0 and server.ask(root + "%d/%d/%d.terrain" % t).status != 404], [])
for path in ("13/0/0.terrain", "99999999/1/0.terrain", "0/2/0.terrain", "0/1/1.terrain", "00/1/0.terrain", "0/01/0.terrain", "0/1/0", "0/1/.terrain",
             "0/1/0.terrain.terrain", "-0/1/0.terrain", "0/1/0x.terrain", "999999999999/1/0.terrain", "0/1/0.terrain/0", "", "0"):
    s.equal("no tile at " + path, server.ask(root + path).status, 404)
s.equal("... but at 0/1/0.terrain", server.ask(root + "0/1/0.terrain").status, 200)
answer = server.ask("/collections/flat/tiles/quantized-mesh/layer.json")
s.check("a terrain without tiles says why", answer.status == 400 and "longitude and latitude on WGS 84" in answer.detail(), answer.detail())
s.equal("the service lives", (server.is_alive(), server.ask("/healthz").status), (True, 200))
server.process.terminate()
s.equal("... and ends well", server.process.wait(30), 0)

# A fiftieth of a second is too short to look at 900 x 900 samples without a triangle, but not for a part of them.
bare = s.temp("bare.gpkg")
s.import_terrain(bare, s.write_grid(s.temp("bare.asc"), [[None if (row + col) % 2 else 100 + row % 7 * col % 5 for col in range(900)] for row in range(900)], 12.3, 45.6, 1 / 1200, s.WGS84),
                 name="bare")
server = service.Service(bare, "--max-seconds", "0.02", "--workers", "1")
told = []


def is_answered():
    told.append(server.ask("/collections/bare/tiles/quantized-mesh/layer.json"))
    return told[-1].status != 503


s.check("who asks again for what takes too long is answered", service.wait_until(is_answered) and told[-1].status == 200, told[-1].body[:200])
s.check("... and was told to", any("ask again, and it goes on from here" in answer.detail() and answer.retry_after == "1" for answer in told[:-1]), [a.body[:200] for a in told[:3]])
s.run([s.RQT, "tiles", bare, "-o", s.temp("bare")])
s.equal("... with the same", told[-1].body, open(s.temp("bare") + "/layer.json", "rb").read())
server.process.terminate()
s.equal("... and the service ends well", server.process.wait(30), 0)

s.finish()
