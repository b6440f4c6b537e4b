-- SPDX-License-Identifier: Apache-2.0
-- What only a server has.

-- name: now
SELECT CAST(floor(extract(epoch FROM clock_timestamp()) * 1000000) AS BIGINT);
