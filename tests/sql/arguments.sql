-- Bad arguments: always an error that names the function and the argument, never an empty answer.
--# database tent

-- eps
SELECT * FROM rqt_range(NULL, NULL);
--! rqt_range(): eps must be a number
SELECT * FROM rqt_triangles(NULL, 'nan');
--! rqt_triangles(): eps must be a number
SELECT * FROM rqt_strip(NULL, 'five');
--! rqt_strip(): eps must be a number
SELECT * FROM rqt_verify(NULL, x'00');
--! rqt_verify(): eps must be a number
SELECT * FROM rqt_explain(NULL, -1);
--! rqt_explain(): eps must be 0 or more
SELECT * FROM rqt_range(NULL, -1e-300);
--! rqt_range(): eps must be 0 or more
SELECT * FROM rqt_range(NULL, -9e999);
--! rqt_range(): eps must be 0 or more
SELECT * FROM rqt_range(NULL, 9e999 - 9e999);
--! rqt_range(): eps must be a number
SELECT rqt_mesh(NULL, NULL, 'obj');
--! rqt_mesh(): eps must be a number
SELECT rqt_mesh(NULL, 'nan', 'obj');
--! rqt_mesh(): eps must be a number
SELECT rqt_mesh(NULL, -0.5, 'strip');
--! rqt_mesh(): eps must be 0 or more
SELECT rqt_height(2, -2, -1);
--! rqt_height(): eps must be 0 or more
SELECT rqt_height(2, -2, 'nan');
--! rqt_height(): eps must be a number
SELECT * FROM rqt_range(NULL);
--! rqt_range(): eps is missing
SELECT * FROM rqt_range;
--! rqt_range(): region is missing
SELECT * FROM rqt_verify WHERE eps = 1;
--! rqt_verify(): region is missing
SELECT * FROM rqt_triangles(NULL, 1, 'tent', NULL, 5);
--! too many arguments
SELECT rqt_mesh(NULL, 1);
--! wrong number of arguments
-- Text that is a number is one; so are zero, minus zero and infinity.
SELECT count(*) FROM rqt_triangles(NULL, '1');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, -0.0);
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 9e999);
--> 2
SELECT count(*) FROM rqt_triangles(NULL, 4);
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 8);
--> 2
SELECT count(*) FROM rqt_triangles(NULL, 7.96875);
--> 4

-- region
SELECT * FROM rqt_range(5, 1);
--! rqt_range(): region must be WKT text, a geometry or NULL
SELECT * FROM rqt_range(5.5, 1);
--! rqt_range(): region must be WKT text, a geometry or NULL
SELECT * FROM rqt_range('', 1);
--! rqt_range(): region: 
SELECT * FROM rqt_range('here', 1);
--! rqt_range(): region: 
SELECT * FROM rqt_range('POLYGON((0 0, 1 0, 1', 1);
--! rqt_range(): region: 
SELECT * FROM rqt_range('POLYGON((0 0, 1 0, 1 nan, 0 0))', 1);
--! rqt_range(): region: 
SELECT * FROM rqt_range('POINT(1 -1) and more', 1);
--! rqt_range(): region: 
SELECT * FROM rqt_range('POLYGON((0 0, 4 0, 4 -4))', 1);
--! rqt_range(): region: 
SELECT * FROM rqt_triangles(x'', 1);
--! rqt_triangles(): region: 
SELECT * FROM rqt_triangles(x'47', 1);
--! rqt_triangles(): region: 
SELECT * FROM rqt_triangles(x'deadbeef', 1);
--! rqt_triangles(): region: 
SELECT * FROM rqt_triangles(substr(rqt_bbox(0, -4, 4, 0), 1, 50), 1);
--! rqt_triangles(): region: 
SELECT rqt_mesh(substr(rqt_bbox(0, -4, 4, 0), 1, length(rqt_bbox(0, -4, 4, 0)) - 1), 1, 'ply');
--! rqt_mesh(): region: 
SELECT * FROM rqt_verify(zeroblob(93), 1);
--! rqt_verify(): region: 
SELECT * FROM rqt_explain('GEOMETRYCOLLECTION(TIN(((0 0, 1 0, 1 -1, 0 0))))', 1);
--! rqt_explain(): region: 
-- Every shorter piece of a geometry is an error too.
WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < 3)
SELECT i, (SELECT count(*) FROM rqt_range(substr('POINT(1 -1)', 1, 11 - i), 1)) FROM n;
--! rqt_range(): region: 

-- a region of another SRID
SELECT * FROM rqt_range('SRID=4326;POINT(1 -1)', 1);
--! rqt_range(): region has SRID 4326, terrain tent has
SELECT rqt_mesh(rqt_circle(1, -1, 1000), 1, 'strip');
--! rqt_mesh(): region has SRID 4326, terrain tent has
SELECT * FROM rqt_verify(rqt_bbox(0, -4, 4, 0, 3857), 1);
--! rqt_verify(): region has SRID 3857, terrain tent has
-- GeoPackage's 0 and -1 mean the terrain's.
SELECT count(*) FROM rqt_triangles(rqt_bbox(0, -4, 4, 0, -1), 1);
--> 4
SELECT count(*) FROM rqt_triangles(rqt_bbox(0, -4, 4, 0, 0), 1);
--> 4

-- format
SELECT rqt_mesh(NULL, 1, 'dxf');
--! rqt_mesh(): unknown format "dxf"
SELECT rqt_mesh(NULL, 1, 'OBJ');
--! rqt_mesh(): unknown format "OBJ"
SELECT rqt_mesh(NULL, 1, '');
--! rqt_mesh(): unknown format ""
SELECT rqt_mesh(NULL, 1, NULL);
--! rqt_mesh(): format must be a text: one of strip indexed rqt obj
SELECT rqt_mesh(NULL, 1, 7);
--! rqt_mesh(): format must be a text
SELECT rqt_mesh(NULL, 1, 'obj+quantized');
--! rqt_mesh(): format "obj" is not quantized; glb can be
SELECT rqt_mesh(NULL, 1, 'rqt+quantized+normals');
--! rqt_mesh(): format "rqt" is not quantized; glb can be
SELECT rqt_mesh(NULL, 1, 'glb+normals+quantized');
--! rqt_mesh(): unknown format "glb+normals+quantized"; there are strip
SELECT rqt_mesh(NULL, 1, 'strip+quantized');
--! rqt_mesh(): format "strip" is not quantized; glb can be
SELECT typeof(rqt_mesh(NULL, 1, 'rqt')), hex(substr(rqt_mesh(NULL, 1, 'rqt'), 1, 5));
--> blob|5251545701

-- terrain
SELECT * FROM rqt_range(NULL, 1, 'hill');
--! rqt_range(): 
SELECT * FROM rqt_range(NULL, 1, 'TENT');
--! TENT
SELECT * FROM rqt_range(NULL, 1, '');
--! rqt_range(): 
SELECT * FROM rqt_range(NULL, 1, 'tent; DROP TABLE rqt_terrain');
--! rqt_range(): 
SELECT * FROM rqt_range(NULL, 1, 1);
--! rqt_range(): terrain must be a name
SELECT * FROM rqt_range(NULL, 1, x'74656e74');
--! rqt_range(): terrain must be a name
SELECT rqt_height(2, -2, 1, 'hill');
--! rqt_height(): 
SELECT * FROM rqt_check('hill');
--! rqt_check(): 
SELECT count(*) FROM rqt_triangles(NULL, 1, NULL);
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, 'tent');
--> 4
SELECT count(*) FROM rqt_triangles(NULL, 1, 'main.tent');
--> 4

-- places
SELECT rqt_height('here', 1);
--! rqt_height(): x must be a number
SELECT rqt_height(1, NULL);
--! rqt_height(): y must be a number
SELECT rqt_height(1);
--! wrong number of arguments

--# database two
SELECT * FROM rqt_range(NULL, 1);
--! ramp
SELECT * FROM rqt_range(NULL, 1, NULL);
--! tent
SELECT rqt_height(1, -1);
--! rqt_height(): 
SELECT rqt_mesh(NULL, 1, 'obj');
--! rqt_mesh(): 
SELECT * FROM rqt_verify(NULL, 1, 'peak');
--! ramp
SELECT count(*) FROM rqt_triangles(NULL, 1, 'ramp');
--> 2
SELECT count(*) FROM rqt_triangles(NULL, 1, 'tent');
--> 4
SELECT rqt_height(2, -2, 0, 'ramp'), rqt_height(2, -2, 0, 'tent');
--> 4.0|8.0
SELECT * FROM rqt_check();
SELECT * FROM rqt_check('ramp');

--# database none
SELECT * FROM rqt_range(NULL, 1);
--! rqt_range(): 
SELECT rqt_height(1, 1);
--! rqt_height(): 
SELECT * FROM rqt_terrains;
SELECT * FROM rqt_check;

-- An import that did not finish is refused, and shown as what it is.
--# database tent
UPDATE rqt_terrain SET complete = 0;
SELECT * FROM rqt_range(NULL, 1);
--! tent
SELECT * FROM rqt_range(NULL, 1, 'tent');
--! incomplete
SELECT rqt_height(2, -2, 1, 'tent');
--! incomplete
SELECT name, complete FROM rqt_terrains;
--> tent|0
SELECT severity, message FROM rqt_check;
--> error|terrain tent is incomplete: its import did not finish

-- An argument too many is an error, not a filter on a hidden column.
SELECT count(*) FROM rqt_range(NULL, 1, 'tent', NULL, 5);
--! rqt_range(): too many arguments
SELECT count(*) FROM rqt_terrains('x');
--! rqt_terrains(): too many arguments
SELECT count(*) FROM rqt_terrains WHERE +k > 0;
--> 1
