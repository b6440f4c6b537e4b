-- SPDX-License-Identifier: Apache-2.0
-- Whose key or certificate a worker came with first: others may not take its name. '': nobody asked for one.
ALTER TABLE workers ADD COLUMN owner TEXT NOT NULL DEFAULT '';
