-- Looking into blocks, and what rqt_check finds in them.
--# database spike
SELECT * FROM rqt_check;
SELECT * FROM rqt_check('spike');
SELECT * FROM rqt_check(NULL);
SELECT DISTINCT rqt_block_check(data) FROM rqt_block_1;
--> ok
SELECT json_extract(rqt_block_info(data), '$.version'), json_extract(rqt_block_info(data), '$.bytes') = length(data) FROM rqt_block_1 WHERE id = 1;
--> 1|1
SELECT count(*) FROM rqt_block_1 WHERE json_extract(rqt_block_info(data), '$.k') <> (SELECT k FROM rqt_terrains);
--> 0
SELECT DISTINCT json_extract(rqt_block_info(data), '$.quantum') FROM rqt_block_1;
--> 1.0
-- The void is in the last block of the finest level; the spike in one of them.
SELECT json_extract(rqt_block_info(data), '$.voids') FROM rqt_block_1 ORDER BY id DESC LIMIT 1;
--> some
SELECT count(*) > 0 FROM rqt_block_1 WHERE rqt_block_dump(data) LIKE '% 10 %';
--> 1
SELECT rqt_block_dump(data) LIKE '%heights in quanta%-%error codes%0%' FROM rqt_block_1 ORDER BY id DESC LIMIT 1;
--> 1
SELECT rqt_block_info(NULL), rqt_block_check(NULL), rqt_block_dump(NULL);
--> NULL|NULL|NULL

-- not a block
SELECT rqt_block_info('text');
--! rqt_block_info(): blob must be a BLOB
SELECT rqt_block_check(5);
--! rqt_block_check(): blob must be a BLOB
SELECT rqt_block_dump('text');
--! rqt_block_dump(): blob must be a BLOB
SELECT rqt_block_info(x'');
--! rqt_block_info(): 
SELECT rqt_block_dump(zeroblob(100));
--! rqt_block_dump(): 
SELECT rqt_block_check(x'') <> 'ok', rqt_block_check(zeroblob(100)) <> 'ok', typeof(rqt_block_check(x''));
--> 1|1|text
SELECT rqt_block_info();
--! wrong number of arguments
SELECT rqt_block_info(x'', 1);
--! wrong number of arguments

-- cut at every byte
WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < 5000), block(data) AS (SELECT data FROM rqt_block_1 WHERE id = 1)
SELECT count(*) FROM n, block WHERE i < length(data) AND rqt_block_check(substr(data, 1, i)) = 'ok';
--> 0
-- one byte too many
SELECT count(*) FROM rqt_block_1 WHERE rqt_block_check(data || x'00') = 'ok';
--! rqt_block_check(): blob must be a BLOB
SELECT count(*) FROM rqt_block_1 WHERE rqt_block_check(CAST(data || x'00' AS BLOB)) = 'ok';
--> 0
-- another byte at every place
WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 5000), block(data) AS (SELECT data FROM rqt_block_1 WHERE id = 1)
SELECT count(*) FROM n, block WHERE i <= length(data)
  AND rqt_block_check(CAST(substr(data, 1, i - 1) || char(90) || substr(data, i + 1) AS BLOB)) = 'ok' AND substr(data, i, 1) <> x'5A';
--> 0

-- A corrupt block is an error where it is read, and a finding of the check.
UPDATE rqt_block_1 SET data = CAST(substr(data, 1, length(data) - 1) AS BLOB);
SELECT * FROM rqt_range(NULL, 0);
--! rqt_range(): 
SELECT * FROM rqt_verify(NULL, 0);
--! rqt_verify(): 
SELECT rqt_mesh(NULL, 0, 'strip');
--! rqt_mesh(): 
SELECT rqt_height(1031, 2040);
--! rqt_height(): 
SELECT count(*) >= (SELECT blocks FROM rqt_terrains), min(severity), count(block) > 0 FROM rqt_check;
--> 1|error|1

--# database spike
UPDATE rqt_block_1 SET summary = x'00' WHERE id = 1;
SELECT count(*) > 0 FROM rqt_check WHERE severity = 'error' AND block = 1;
--> 1
--# database spike
DELETE FROM rqt_block_1 WHERE id = (SELECT max(id) FROM rqt_block_1);
SELECT count(*) > 0 FROM rqt_check WHERE severity = 'error';
--> 1
SELECT * FROM rqt_range(NULL, 0);
--! rqt_range(): 
--# database spike
DELETE FROM rqt_index_1;
SELECT count(*) > 0 FROM rqt_check WHERE severity = 'error';
--> 1
SELECT * FROM rqt_triangles(NULL, 0);
--! rqt_triangles(): 
--# database spike
UPDATE rqt_index_1 SET exact1 = exact1 - 1 WHERE id = (SELECT min(id) FROM rqt_index_1 WHERE exact1 < 65536);
SELECT count(*) > 0 FROM rqt_check WHERE severity = 'error';
--> 1
--# database spike
UPDATE rqt_terrain SET width = 8;
SELECT count(*) > 0 FROM rqt_check WHERE severity = 'error';
--> 1
--# database spike
UPDATE rqt_terrain SET dx = 0;
SELECT * FROM rqt_range(NULL, 0);
--! terrain spike
SELECT name, width FROM rqt_terrains;
--> spike|NULL
SELECT message FROM rqt_check;
--> terrain spike: its row in rqt_terrain has an impossible placement
--# database spike
UPDATE rqt_terrain SET format = 2;
SELECT * FROM rqt_range(NULL, 0);
--! terrain spike has format 2; this version reads format 1
--# database spike
DROP TABLE rqt_block_1;
SELECT * FROM rqt_range(NULL, 0);
--! rqt_range(): 
SELECT rqt_height(1031, 2040);
--! rqt_height(): 
