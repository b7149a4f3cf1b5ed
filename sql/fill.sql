-- Samples of terrain {N} that were no data: runs along rows, north to south. kind: 1 filled between neighbours, 2 sea.
CREATE TABLE rqt_fill_{N} (
  id INTEGER PRIMARY KEY,
  row INTEGER NOT NULL,
  col0 INTEGER NOT NULL,
  col1 INTEGER NOT NULL,
  kind INTEGER NOT NULL
);
