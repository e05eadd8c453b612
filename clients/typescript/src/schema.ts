/**
 * Types of the service's API. Generated from its OpenAPI document by `make client-types`: do not edit.
 *
 * openapi sha256 c2ce3fc131e0abc2ca6e418020410ac5ca9e6fb74bd31685a7ae1069bbc964d5
 */

export interface paths {
    "/": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Landing page
         * @description Lists the collections that the caller may see, and the service's pages, as JSON. A browser, which prefers HTML,
         *     is sent on to the console.
         */
        get: operations["getLandingPage"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/livez": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Is the process alive?
         * @description Answers 200 as long as the process can answer.
         */
        get: operations["getLiveness"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/metrics": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Metrics for Prometheus
         * @description Returns the metrics of all processes of this service. They name collections, so the key must see them all.
         */
        get: operations["getMetrics"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/ogc": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Landing page for GIS
         * @description The address to give to QGIS or GDAL: OGC API - Features, read only. Links lead to all that the key may see.
         */
        get: operations["getFeaturesLandingPage"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/ogc/collections": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the feature collections
         * @description Lists two feature collections for each collection that the key may see: its landmarks and its submaps.
         */
        get: operations["listFeatureCollections"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/ogc/collections/{collection}:{kind}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Describe a feature collection
         * @description Describes a feature collection. It has an extent if a map frame has a coordinate reference system.
         */
        get: operations["getFeatureCollection"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/ogc/collections/{collection}:{kind}/items": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read features
         * @description Returns features as GeoJSON in longitude and latitude, in the order in which submaps were stored. The link `next`
         *     leads to the next page; the last page has none.
         *
         *     Writes in between move nothing. A page may have fewer features than `limit`, or none, and still a next one. What is
         *     in a map frame without a coordinate reference system has no geometry, and `no_geometry` says why.
         */
        get: operations["listFeatures"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/ogc/collections/{collection}:{kind}/items/{feature}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read a feature
         * @description Returns one feature as GeoJSON in longitude and latitude.
         */
        get: operations["getFeature"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/ogc/conformance": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the conformance classes
         * @description Lists what parts of OGC API - Features the service conforms to: Core and GeoJSON.
         */
        get: operations["getConformance"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/problems/{slug}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Explain a type of problem
         * @description Explains a type of problem. The `type` of every problem document is a link to this route.
         */
        get: operations["getProblem"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/readyz": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Is the service ready?
         * @description Answers 503 while migrations, kernels or the index are not ready, while the database file is not the one that was
         *     opened, and when the service is about to stop; `check` says which. Requests that do not need the database are still
         *     answered.
         *
         *     `load` shows how busy the process is. Saturation alone does not cause 503, because every caller still gets its
         *     share.
         */
        get: operations["getReadiness"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the collections
         * @description Lists the collections that the key may see, in the order they were created. The last page has no `next`.
         */
        get: operations["listCollections"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read a collection
         * @description Returns configuration, fingerprint, counts, extent and revision.
         */
        get: operations["getCollection"];
        /**
         * Create a collection
         * @description Creates the collection, or confirms that it exists. Members that you leave out are not compared, so `{}` only
         *     makes sure that it exists.
         *
         *     409 if it exists and differs in a member that you send.
         */
        put: operations["putCollection"];
        post?: never;
        /**
         * Delete a collection
         * @description Deletes the collection with everything in it.
         */
        delete: operations["deleteCollection"];
        options?: never;
        head?: never;
        /**
         * Change a collection
         * @description Changes title, crs, origin and frames. null removes a member; members that you leave out stay. The configuration
         *     cannot be changed (409).
         *
         *     422 if a CRS or origin would put a stored submap outside the area of that CRS.
         */
        patch: operations["patchCollection"];
        trace?: never;
    };
    "/v1/collections/{collection}/constraints": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the constraints
         * @description Lists the constraints that the collection keeps, in the order they were stored: matches that jobs found, and
         *     odometry that was posted. The last page has no `next`.
         *
         *     With `format`, all of them come at once. g2o, matrices, TUM and KITTI leave stale ones out; TUM and KITTI have the
         *     pose of each submap, in its map frame or along the constraints.
         */
        get: operations["listConstraints"];
        put?: never;
        /**
         * Find constraints between submaps
         * @description Looks each chosen submap up in all others. Each accepted match becomes a constraint `from_T_to` of a pose graph,
         *     one for each pair. The job's results are available as NDJSON, JSON, g2o and 4 x 4 matrices.
         */
        post: operations["postConstraints"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/constraints/{constraint}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post?: never;
        /**
         * Delete a constraint
         * @description Deletes a constraint. A match is found again once one of its submaps is looked up again.
         */
        delete: operations["deleteConstraint"];
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/coregistrations": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Place a season's plots in a map
         * @description Uploads files of plots. A job then places each plot in the map of the collection, as `urquhart coregister` does.
         *
         *     A plot that cannot be read or found is a row, and the others are placed. The job's results have a line for each
         *     plot, and `/v1/jobs/{job}/files` its tables, GeoPackages, transforms, pictures and `report.html`. Several files are
         *     sent as a zip archive, in which a `columns.toml` may say what columns mean.
         */
        post: operations["postCoregistration"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/exports/{table}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Export a collection as a file
         * @description Returns all landmarks, submaps, matches or pairs as CSV, GeoJSON, GeoPackage or GeoParquet, by `Accept` or
         *     `format`.
         *
         *     Positions are full coordinates of the map frame's coordinate reference system; a frame without one is written as a
         *     local engineering system with its name (CSV leaves `crs` empty). GeoJSON is in longitude and latitude: 406 if no map
         *     frame has a coordinate reference system. CSV and GeoJSON are sent while they are read. What is stored meanwhile may
         *     be missing.
         */
        get: operations["getExport"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/imports": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Store many submaps
         * @description Uploads submaps as NDJSON. A job then stores them, with one result for each line.
         *
         *     An upload counts only when complete. If an id comes twice in one upload, the last line counts with
         *     `on_conflict=replace`, the first with `skip` and `fail`. Blank lines count towards `import_lines`.
         */
        post: operations["postImport"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/landmarks": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read landmarks as binary columns
         * @description Returns boxes of submaps and positions of their trees in a map frame, to be drawn: far smaller and faster to read
         *     than JSON. Submaps without a `map_pose` in the frame are left out. For all attributes of every tree, see
         *     [exports](#getexport).
         *
         *     Little-endian: the 8 bytes `URQCOL1\n`; uint32, the length of the head; the head: JSON, padded with spaces to a
         *     multiple of 4, with `origin` [x, y], `landmarks` (trees in all), `every` (1, or every how-many-th tree is here), ids
         *     of the `submaps`, their `stamps` (seconds since 1970 UTC, or null), names of the `sessions`, and in `session_of` the
         *     position of each submap's session, -1 for none.
         *     Then float32 (S, 4), the box of each submap; uint32 (S), how many positions it has here; float32 (N, 2), the
         *     positions, submap after submap. Metres, relative to `origin`.
         */
        get: operations["getLandmarks"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/maps": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Build a map
         * @description Matches the chosen submaps with each other, optimises their poses together, and merges their trees.
         *
         *     Matches that contradict the largest consistent set of them are left out. Parts that no constraint connects get map
         *     frames of their own. With `apply`, all poses are written in one transaction, under one new revision of the
         *     collection; if a submap got other landmarks meanwhile, none is. The results are lines of NDJSON; the map is also at
         *     `/v1/collections/{collection}/maps/{id}`.
         */
        post: operations["postMap"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/maps/{map}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read a map
         * @description Returns a map in numbers, the pose of each submap, and what became of each constraint. A map is kept as long as
         *     the job that built it.
         */
        get: operations["getMap"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/maps/{map}/landmarks": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read the trees of a map
         * @description Returns one entry for each tree of a part of a map: its position with its covariance, diameter and height, and in
         *     how many submaps it was observed and missed.
         */
        get: operations["getMapLandmarks"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/merges": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Lay one map frame onto another
         * @description Matches the submaps of the map frame `from` with those of the map frame `to`. The pose that most matches agree on
         *     joins the frames, if at least 4 of them have no submap in common, and half as many at most agree on another pose.
         *     The other matches are named with reasons. With `apply`, all submaps of `from` get poses in `to`, in one transaction,
         *     under one new revision of the collection. The merge is at `/v1/collections/{collection}/merges/{id}`.
         */
        post: operations["postMerge"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/merges/{merge}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read a merge
         * @description Returns how two map frames lie to each other, and what became of each match between them. A merge is kept as long
         *     as its job.
         */
        get: operations["getMerge"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/odometry": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Store relative poses that a robot measured
         * @description Stores relative poses as constraints, all in one transaction or none. Maps of these submaps believe them within
         *     their covariances, unless several independent matches contradict one.
         */
        post: operations["postOdometry"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/poses": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Write the poses of many submaps
         * @description Writes map poses that you have optimised yourself, all in one transaction under one new revision of the
         *     collection, or none. A query sees the poses of before or those of after. Landmarks and the index stay as they are.
         */
        post: operations["postPoses"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/queries": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List stored queries
         * @description Lists the queries that were sent with `store` and are still kept, newest first. A page may have fewer entries
         *     than `limit`, and still a `next`, if few queries have the verdict.
         */
        get: operations["listQueries"];
        put?: never;
        /**
         * Find where an observation was made
         * @description Decide by `verdict` (`matched`, `ambiguous` or `no_match`), not by the pose. Too few trees give `no_match`, not
         *     an error; `reason` says why.
         *
         *     The search covers every submap stored before the request. A query with `store` is a write: repeated with the same
         *     `Idempotency-Key`, it returns the first answer. Other queries change nothing and are searched again.
         */
        post: operations["query"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/queries/{query}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read a stored answer
         * @description Returns the answer to a query that was sent with `store`. 410 if it is no longer kept.
         */
        get: operations["getQuery"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/queries/{query}/candidates/{rank}/match": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Draw a match
         * @description Describes a candidate of a stored query as JSON, or draws it with `Accept: image/svg+xml`: both sets of trees
         *     overlaid, with lines between inliers.
         *
         *     With `Accept: text/csv` or `application/geo+json` it lists every tree of the query with its partner among all trees
         *     of the map there (`seen`: `both`), or without (`query`), and the trees of the map amid them that have none (`map`).
         *     Positions are full coordinates of the map frame, in GeoJSON longitude and latitude.
         *
         *     The drawing shows at most 5,000 landmarks of each side, those in the overlap first, and says if there are more. 503
         *     if drawing takes longer than `query_seconds`. 410 if the submap's landmarks have changed since.
         */
        get: operations["getMatch"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/queries/{query}/explanation": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Explain an answer
         * @description Shows the time of each stage, and what each level found in each submap compared with the gates. As JSON, or as
         *     a drawing with `Accept: image/svg+xml`.
         *
         *     The drawing overlays the query on the best candidate and on its strongest rival. 410 if the answer is no longer
         *     kept.
         */
        get: operations["getExplanation"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/queries/batch": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Send several queries at once
         * @description Each query is answered as if it were sent alone. `results` keeps the order; an invalid query has a `problem` in
         *     its place.
         *
         *     If you repeat the batch with the same `Idempotency-Key`, queries with `store` return their first answer, and the
         *     others are searched again.
         */
        post: operations["queryBatch"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/reindex": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Rewrite the index
         * @description Rebuilds the index from the landmarks. Queries use the old index until the new one is complete. 409 if a rebuild
         *     is already running.
         */
        post: operations["postReindex"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/sessions": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the sessions
         * @description Lists sessions by name, each with its number of submaps and its first and last stamp. Submaps without a session
         *     are left out.
         */
        get: operations["listSessions"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/sessions/{session}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        post?: never;
        /**
         * Delete a session
         * @description Deletes all submaps of a session, in one transaction. The next query no longer finds them. Constraints between
         *     them and other submaps become stale.
         */
        delete: operations["deleteSession"];
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/sessions/{session}/poses": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read the poses of a session now
         * @description Returns where each submap of a session is, by all matches and odometry that the collection keeps of it now. The
         *     frame is that of the session's first submap; parts that nothing connects have frames of their own.
         *
         *     Odometry and matches that came since the last answer are taken in at once, in about 50 ms for 1,000 submaps. What
         *     only a search of all constraints can judge is `pending` until that has run in the background; false loops are kept
         *     out as they are from maps. The first answer after the service started, or after a submap was deleted or replaced,
         *     needs such a search; if it takes longer than `query_seconds`, this is 503 with `Retry-After`, and the search goes
         *     on. No stored pose is changed.
         */
        get: operations["getSessionPoses"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/stands": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the stands
         * @description Lists what stem maps were stored, in the order they were first stored. The last page has no `next`.
         *
         *     `urquhart index` stores stem maps on the host.
         */
        get: operations["listStands"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/stands/{stand}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read a stand
         * @description Returns what is known of a stand: its file's digest, its dates, its map frame, and how much it contains.
         */
        get: operations["getStand"];
        /**
         * Store a file of trees as a stand
         * @description Reads a file, cuts it into overlapping submaps, and stores them as the stand of this name, in one transaction.
         *
         *     `understood` and `rows` say how the file was read, and what was left out. Everything that the stand had before is
         *     replaced. Queries find the stand as it was or as it is, and nothing between. A stand that exists is cut as it was,
         *     if neither `radius` and `spacing` nor `one_submap` is given.
         */
        put: operations["putStand"];
        post?: never;
        /**
         * Delete a stand
         * @description Deletes a stand with all its submaps, in one transaction. The next query no longer finds them.
         *
         *     A submap that a PUT took out of the stand stays.
         */
        delete: operations["deleteStand"];
        options?: never;
        head?: never;
        /**
         * Move a stand
         * @description Moves all submaps of a stand together in their map frame, in one transaction. Landmarks and the index stay as
         *     they are. Storing the stand's file again puts it where the file says.
         *
         *     409 if its submaps are in several map frames, or in none. To say where the map frame itself is on Earth, PATCH the
         *     collection's `crs`, `origin` or `frames`.
         */
        patch: operations["patchStand"];
        trace?: never;
    };
    "/v1/collections/{collection}/submaps": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the submaps
         * @description Lists submaps in the order they were stored, without landmarks. The last page has no `next`.
         *
         *     With `Accept: application/geo+json`, returns footprints in longitude and latitude for submaps whose map frame has a
         *     CRS.
         */
        get: operations["listSubmaps"];
        put?: never;
        /**
         * Store a new submap
         * @description Stores a submap under an id that the service generates; later ids sort after earlier ones. If you repeat the
         *     request with the same `Idempotency-Key`, nothing is stored again and you get the first answer.
         */
        post: operations["postSubmap"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/collections/{collection}/submaps/{submap}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read a submap
         * @description Returns a submap with its landmarks.
         */
        get: operations["getSubmap"];
        /**
         * Store a submap
         * @description Creates the submap or replaces it as a whole: members that you leave out are removed, and `cleared` names them.
         *     Use PATCH to keep them. Sending the same content again changes nothing. The next query finds the submap.
         *
         *     With `query`, the service first searches for this place among all other submaps stored before.
         */
        put: operations["putSubmap"];
        post?: never;
        /**
         * Delete a submap
         * @description Deletes a submap. The next query no longer finds it.
         */
        delete: operations["deleteSubmap"];
        options?: never;
        head?: never;
        /**
         * Change a submap
         * @description Replaces the members that you send; null removes a member; members that you leave out stay. `xy` or `landmarks`
         *     replace all landmarks, and only then is the submap indexed again.
         *
         *     The answer contains the landmarks, so the key also needs the scope `read`.
         */
        patch: operations["patchSubmap"];
        trace?: never;
    };
    "/v1/collections/{collection}/submaps/{submap}/tessellation": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Show the tessellation of a submap
         * @description Returns triangles, Urquhart polygons and their descriptors, as JSON or GeoJSON, or draws them as SVG.
         *
         *     The drawing shows the 5,000 landmarks nearest to the middle, and says if there are more. 503 if drawing takes longer
         *     than `query_seconds`.
         */
        get: operations["getTessellation"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the jobs
         * @description Lists jobs of the collections that the key may see, newest first. The last page has no `next`.
         */
        get: operations["listJobs"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs/{job}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Follow a job
         * @description Returns the progress of a job. Until it is finished, `Retry-After` says when to ask again. If too many callers
         *     wait already (`job_waits`, `key_job_waits` in GET /v1/limits), the answer comes at once.
         */
        get: operations["getJob"];
        put?: never;
        post?: never;
        /**
         * Cancel or forget a job
         * @description Ends an unfinished job after the work in progress; what it has stored stays (202). Deletes a finished job with
         *     its results (204). A key may cancel its own jobs with any scope; those of others need `write` or `admin`.
         */
        delete: operations["deleteJob"];
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs/{job}/errors": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read the refused lines of a job
         * @description Returns only the results of refused lines.
         */
        get: operations["getJobErrors"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs/{job}/files": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the files that a job wrote
         * @description Lists the files of a coregistration that has ended: the tables, GeoPackages, transforms, pictures and the report
         *     that docs/files.md explains. They are kept as long as the job's results.
         */
        get: operations["listJobFiles"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs/{job}/files/{file}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Download a file that a job wrote
         * @description Returns one of the files that the list names, as an attachment of its media type.
         */
        get: operations["getJobFile"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/jobs/{job}/results": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read the results of a job
         * @description Imports: one line for each line of the upload, with its number, `outcome`, and the `problem` if it was refused.
         *     `created`, `replaced` and `unchanged` mean the same as for PUT. `skipped` lines were not stored: the id is taken
         *     (on_conflict=skip), or another line was refused (mode=all). If very many lines are refused, later ones are
         *     shortened, and those beyond `import_refusal_bytes` are only counted: one line for each kind of problem, with the
         *     number of `lines`, the first (`line`) and the `last_line`.
         *
         *     Constraints: one line for each, with `from`, `to` and the transform from_T_to; or all in another `format`.
         *     Constraints of submaps that were changed or deleted since are `stale`; g2o and matrices leave them out, and the
         *     header `X-Stale-Constraints` counts them. `g2o_middle` is for coordinates far from the origin: each vertex lies
         *     among the trees of its submap, at the coordinates that follow its name in the comments.
         *
         *     Coregistrations: one line for each plot, as in `plots.csv` of the job's files.
         */
        get: operations["getJobResults"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/limits": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the limits
         * @description Returns limits on sizes, times and rates, retention periods, versions. Problems use these names in `limit`.
         */
        get: operations["getLimits"];
        put?: never;
        post?: never;
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/snapshots": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * List the snapshots
         * @description Lists snapshots, oldest first. The last page has no `next`.
         */
        get: operations["listSnapshots"];
        put?: never;
        /**
         * Create a snapshot
         * @description Copies the whole database, including the hashes of API keys. Reads and writes continue meanwhile.
         *
         *     The copy contains every write acknowledged before the request. The oldest snapshots beyond `snapshots.keep` are
         *     removed. 409 while another snapshot is being made.
         */
        post: operations["postSnapshot"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/snapshots/{snapshot}": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        /**
         * Read or download a snapshot
         * @description Describes a snapshot. With `Accept: application/vnd.sqlite3` it returns the file, whose entity tag is its
         *     SHA-256; `Range` resumes a download.
         *
         *     To restore it, run `urquhart snapshot restore` on the host.
         */
        get: operations["getSnapshot"];
        put?: never;
        post?: never;
        /**
         * Delete a snapshot
         * @description Deletes a snapshot permanently.
         */
        delete: operations["deleteSnapshot"];
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
    "/v1/stem-maps": {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        get?: never;
        put?: never;
        /**
         * Read a file of trees
         * @description Reads a file as `urquhart index` does, and returns its trees. Nothing is stored, so a repeated request with the
         *     same `Idempotency-Key` reads the file again.
         *
         *     CSV, xlsx, GeoPackage, FlatGeobuf, GeoJSON, KML, GPX, LAS and LAZ. `understood` says what was read as what. A file
         *     that cannot be used is refused, with each row at fault in `errors`.
         */
        post: operations["readStemMap"];
        delete?: never;
        options?: never;
        head?: never;
        patch?: never;
        trace?: never;
    };
}
export type webhooks = Record<string, never>;
export interface components {
    schemas: {
        /**
         * ArrivingSubmap
         * @description A submap to store, and on request to search for first.
         */
        ArrivingSubmap: {
            /**
             * Frame Id
             * @description Name of the frame that the landmarks' coordinates are in.
             */
            frame_id?: string | null;
            /**
             * Ids
             * @description Ids of the trees in `xy`, one for each. By default their positions in the list as text, counted from 0.
             */
            ids?: string[] | null;
            /**
             * Landmarks
             * @description The trees, each with its position, attributes and id. The alternative to `xy`.
             */
            landmarks?: components["schemas"]["Landmark"][] | null;
            /** @description Pose of the submap's frame in a map, if it is known. */
            map_pose?: components["schemas"]["MapPose"] | null;
            /**
             * Properties
             * @description Any other data that you want to store with the submap, as a JSON object.
             */
            properties?: {
                [key: string]: unknown;
            } | null;
            /** @description Search for the submap before it is stored, with these options; `{}` for the defaults. It cannot find itself. */
            query?: components["schemas"]["QueryOptions"] | null;
            /**
             * Session
             * @description The drive, flight or survey that the submap belongs to.
             */
            session?: string | null;
            /**
             * Stamp
             * @description When the trees were observed, in RFC 3339 form with an offset. Stored to the microsecond; further digits are cut off.
             */
            stamp?: string | null;
            /**
             * Xy
             * @description Positions of the trees as [x, y], in metres. The alternative to `landmarks`.
             */
            xy?: number[][] | null;
        };
        /**
         * BatchAnswer
         * @description The results of a batch.
         */
        BatchAnswer: {
            /**
             * Results
             * @description An answer or a problem for each query, in the order of the queries.
             */
            results: (components["schemas"]["QueryAnswer"] | components["schemas"]["BatchProblem"])[];
        };
        /**
         * BatchInput
         * @description Several queries in one request.
         */
        BatchInput: {
            /**
             * Queries
             * @description The queries, each with the members of a `QueryInput`.
             */
            queries: {
                [key: string]: unknown;
            }[];
            /**
             * Timeout Ms
             * @description Milliseconds within which you need the whole batch. The limit `batch_seconds` is the maximum and the default. A query that has not begun by then gets the problem `deadline-exceeded`.
             */
            timeout_ms?: number | null;
        };
        /**
         * BatchProblem
         * @description The result of a query that failed.
         */
        BatchProblem: {
            /**
             * Problem
             * @description The problem document that the query alone would have been answered with.
             */
            problem: {
                [key: string]: unknown;
            };
        };
        /**
         * CandidateAnswer
         * @description A submap that may be the query's place, with the evidence.
         */
        CandidateAnswer: {
            /**
             * Confidence
             * @description Calibrated probability that `transform` is right.
             */
            confidence: number;
            /**
             * Evidence
             * @description Natural logarithm of how much likelier the trees of both sides are if this is the same place than if they agree by chance, over all landmarks.
             */
            evidence: number;
            /**
             * Frame Id
             * @description Name of the submap's frame, which `transform` takes points to. Null if it has none.
             */
            frame_id: string | null;
            /** @description The pairs of landmarks as columns, if the query asked for them (`pair_format`). Null otherwise, or if they are left out. */
            inlier_columns?: components["schemas"]["InlierColumns"] | null;
            /**
             * Inlier Count
             * @description Number of pairs of landmarks that agree, whether they are listed or not.
             */
            inlier_count: number;
            /**
             * Inlier Ratio
             * @description `inlier_count` divided by the number of landmarks inside the overlap of both footprints, of the side that has fewer there. 0 to 1.
             */
            inlier_ratio: number;
            /**
             * Inliers
             * @description Pairs of landmarks that are the same tree. Empty if left out (see `inliers_omitted`), or listed in `inlier_columns`.
             */
            inliers: components["schemas"]["Inlier"][];
            /**
             * Inliers Omitted
             * @description Number of pairs that are left out: none, or all of this candidate's. They are left out if the query said `pairs: false`, or if better candidates, or other answers of the batch, used up the limit `answer_pairs`.
             * @default 0
             */
            inliers_omitted: number;
            /**
             * Level
             * @description The step of the search that proposed the pose: matching `quads`, matching `polygons`, an `exhaustive` trial of rotations and shifts, or the `paper`'s method. `given`: a pose of the window of a given `prior`.
             * @enum {string}
             */
            level: "polygons" | "quads" | "exhaustive" | "paper" | "given";
            /** @description Paths that belong to the candidate. */
            links: components["schemas"]["CandidateLinks"];
            /**
             * Log Odds
             * @description `evidence` minus the natural logarithm of the number of poses that there were to choose from, and minus 0.1 for each landmark of the overlap.
             */
            log_odds: number;
            /** @description The query's pose in the map. Null if the submap has no `map_pose`. */
            map_pose: components["schemas"]["MapPoseAnswer"] | null;
            /**
             * Overlap Ratio
             * @description Share of the query's landmarks, 0 to 1, that lie inside the overlap of both footprints.
             */
            overlap_ratio: number;
            /**
             * Rank
             * @description Position among the candidates. The best is 1.
             */
            rank: number;
            /**
             * Refused
             * @description Why this candidate is not accepted, as a stable word: one of those of `reason`. Null if it is accepted.
             */
            refused: string | null;
            /**
             * Rms
             * @description Root mean square of the inliers' residuals, in metres.
             */
            rms: number;
            /**
             * Session
             * @description Session of the submap. Null if it has none.
             */
            session: string | null;
            /**
             * Stamp
             * @description When the submap was observed. Null if that is unknown.
             */
            stamp: string | null;
            /**
             * Submap Id
             * @description Id of the submap.
             */
            submap_id: string;
            /**
             * Support
             * @description How many quads or polygons agree on this pose or, if `level` is `exhaustive`, how many shifts and rotations stood out. Not comparable between levels.
             */
            support: number;
            /** @description The same pose as shift and turn about the middle of the query's trees, in the map frame if the submap has a `map_pose`. Null in answers that an older version stored. */
            survey?: components["schemas"]["SurveyPose"] | null;
            /** @description submap_T_query: p_submap = R(yaw) p_query + (x, y). */
            transform: components["schemas"]["CandidateTransform"];
            /**
             * Warnings
             * @description What is wrong with the coordinates of one side, as stable words. The covariance is widened accordingly. `tilted`: one direction is longer than the other on one side: a sensor was tilted, or drifted along a line; `scaled`: one side is larger than the other: a unit, a range calibration or a map's scale is off; `bent`: one side is bent: it was gathered along a trajectory that drifted; `far_origin`: the query's origin is far from its trees: use the covariance about their middle (`middle`).
             */
            warnings?: string[];
        };
        /**
         * CandidateLinks
         * @description Paths that belong to a candidate.
         */
        CandidateLinks: {
            /**
             * Match
             * @description Path of the drawing of the match. Null if the query is not stored.
             */
            match: string | null;
            /**
             * Submap
             * @description Path of the submap.
             */
            submap: string;
        };
        /**
         * CandidateTransform
         * @description The query's pose in a submap's frame.
         */
        CandidateTransform: {
            /**
             * About
             * @description The point that `covariance` is about: the origin of the query's frame.
             * @default query_origin
             * @constant
             */
            about: "query_origin";
            /**
             * Covariance
             * @description Covariance of the position of the point `about`, along the axes of `covariance_frame`, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. Null if it is unknown.
             */
            covariance: number[] | null;
            /**
             * Covariance Frame
             * @description Axes of `covariance`: those of the submap's frame.
             * @default submap
             * @constant
             */
            covariance_frame: "submap";
            /** @description The uncertainty about the middle of the inlier trees. Null in answers that an older version stored. */
            middle?: components["schemas"]["TreesMiddle"] | null;
            /**
             * X
             * @description Translation along x, in metres, in the frame that the transform takes points to.
             */
            x: number;
            /**
             * Y
             * @description Translation along y, in metres, in the frame that the transform takes points to.
             */
            y: number;
            /**
             * Yaw
             * @description Rotation in radians, counter-clockwise.
             */
            yaw: number;
        };
        /**
         * Collection
         * @description A collection, with its configuration and extent.
         */
        Collection: {
            /**
             * Config
             * @description All parameters of the method, including those with default values.
             */
            config: {
                [key: string]: unknown;
            };
            /** @description How much the collection contains. */
            counts: components["schemas"]["Counts"];
            /**
             * Created
             * @description When the collection was created.
             */
            created: string;
            /**
             * Crs
             * @description Projected coordinate reference system, in metres, of the map frame `map`, such as `EPSG:32633`.
             */
            crs: string | null;
            /** @description The area and the time that the submaps cover. */
            extent: components["schemas"]["Extent"];
            /**
             * Fingerprint
             * @description Hash of the parameters that features are computed with.
             */
            fingerprint: string;
            /**
             * Frames
             * @description CRS and origin of each map frame other than `map`, by the frame's name.
             */
            frames: {
                [key: string]: components["schemas"]["MapFrame"];
            };
            /**
             * Id
             * @description Id of the collection.
             */
            id: string;
            links: components["schemas"]["CollectionLinks"];
            /**
             * Origin
             * @description Easting and northing, in metres, of the origin of the map frame `map` in its CRS.
             */
            origin: number[] | null;
            /**
             * Revision
             * @description Counter of the writes to the collection.
             */
            revision: number;
            /** @description How much the stands contain, which were stored from files. */
            stands: components["schemas"]["StandCounts"];
            /**
             * Systems
             * @description Coordinate reference systems of the map frames and of the stands, each once, as codes or names.
             */
            systems: string[];
            /**
             * Title
             * @description Title of the collection, for people.
             */
            title: string | null;
            /**
             * Updated
             * @description When the collection was last written to.
             */
            updated: string;
        };
        /**
         * CollectionLinks
         * @description Paths of the collection and its parts.
         */
        CollectionLinks: {
            /**
             * Queries
             * @description Path to POST queries to.
             */
            queries: string;
            /**
             * Self
             * @description Path of the collection.
             */
            self: string;
            /**
             * Submaps
             * @description Path of the collection's submaps.
             */
            submaps: string;
        };
        /**
         * CollectionPage
         * @description A page of collections.
         */
        CollectionPage: {
            /**
             * Collections
             * @description The collections of the page, oldest first.
             */
            collections: components["schemas"]["CollectionSummary"][];
            /**
             * Next
             * @description Cursor of the next page. The last page does not have this member.
             */
            next?: string | null;
        };
        /**
         * CollectionPatch
         * @description Members of a collection to change. Null removes a member; a member left out stays.
         */
        CollectionPatch: {
            /**
             * Config
             * @description Parameters of the method. They cannot be changed: send those that the collection has.
             */
            config?: {
                [key: string]: unknown;
            } | null;
            /**
             * Crs
             * @description Projected coordinate reference system, in metres, of the map frame `map`, such as `EPSG:32633`.
             */
            crs?: string | null;
            /**
             * Frames
             * @description CRS and origin of each map frame other than `map`, by the frame's name. A frame that is left out stays; null removes its CRS and origin.
             */
            frames?: {
                [key: string]: components["schemas"]["MapFrame"] | null;
            } | null;
            /**
             * Origin
             * @description Easting and northing, in metres, of the origin of the map frame `map` in its CRS. Leave it out if poses are in full coordinates of the CRS.
             */
            origin?: number[] | null;
            /**
             * Title
             * @description Title of the collection, for people.
             */
            title?: string | null;
        };
        /**
         * CollectionPut
         * @description A collection to create, or to compare with the one that exists. Members left out are not compared.
         */
        CollectionPut: {
            /**
             * Config
             * @description Parameters of the method. Parameters that are left out have their defaults.
             */
            config?: {
                [key: string]: unknown;
            } | null;
            /**
             * Crs
             * @description Projected coordinate reference system, in metres, of the map frame `map`, such as `EPSG:32633`.
             */
            crs?: string | null;
            /**
             * Frames
             * @description CRS and origin of each map frame other than `map`, by the frame's name.
             */
            frames?: {
                [key: string]: components["schemas"]["MapFrame"];
            } | null;
            /**
             * Origin
             * @description Easting and northing, in metres, of the origin of the map frame `map` in its CRS. Leave it out if poses are in full coordinates of the CRS.
             */
            origin?: number[] | null;
            /**
             * Title
             * @description Title of the collection, for people.
             */
            title?: string | null;
        };
        /**
         * CollectionSummary
         * @description A collection, as in a list.
         */
        CollectionSummary: {
            /** @description How much the collection contains. */
            counts: components["schemas"]["Counts"];
            /**
             * Created
             * @description When the collection was created.
             */
            created: string;
            /**
             * Crs
             * @description Projected coordinate reference system, in metres, of the map frame `map`, such as `EPSG:32633`.
             */
            crs: string | null;
            /**
             * Fingerprint
             * @description Hash of the parameters that features are computed with.
             */
            fingerprint: string;
            /**
             * Id
             * @description Id of the collection.
             */
            id: string;
            links: components["schemas"]["CollectionLinks"];
            /**
             * Origin
             * @description Easting and northing, in metres, of the origin of the map frame `map` in its CRS.
             */
            origin: number[] | null;
            /**
             * Revision
             * @description Counter of the writes to the collection.
             */
            revision: number;
            /** @description How much the stands contain, which were stored from files. */
            stands: components["schemas"]["StandCounts"];
            /**
             * Systems
             * @description Coordinate reference systems of the map frames and of the stands, each once, as codes or names.
             */
            systems: string[];
            /**
             * Title
             * @description Title of the collection, for people.
             */
            title: string | null;
            /**
             * Updated
             * @description When the collection was last written to.
             */
            updated: string;
        };
        /**
         * Constraint
         * @description The relative pose of two submaps: from_T_to takes points of `to` into the frame of `from`.
         */
        Constraint: {
            /**
             * Confidence
             * @description Calibrated probability that `transform` is right.
             */
            confidence: number;
            /**
             * From
             * @description Id of the submap whose frame the transform takes points to.
             */
            from: string;
            /**
             * From Revision
             * @description Revision of the collection at which the landmarks of `from` were stored. Null in older results.
             */
            from_revision: number | null;
            /**
             * From Session
             * @description Session of the submap `from`. Null if it has none.
             */
            from_session: string | null;
            /**
             * Information
             * @description Information matrix of the edge, as pose graphs use it: 3x3, row-major over (x, y, yaw), of the error log(measured^-1 true), about the origin of the frame of `to`, along the axes of that frame.
             */
            information: number[];
            /**
             * Information Frame
             * @description Axes of `information`: those of the frame of the submap `to`.
             * @default to
             * @constant
             */
            information_frame: "to";
            /**
             * Inlier Count
             * @description Number of pairs of landmarks that agree.
             */
            inlier_count: number;
            /**
             * Rank
             * @description Rank of the match in its search. Only the match of rank 1 was compared with all rivals; in rows of trees, others are often off by a row. Null in older results.
             * @default null
             */
            rank: number | null;
            /**
             * Rms
             * @description Root mean square of the inliers' residuals, in metres.
             */
            rms: number;
            /**
             * Stale
             * @description Whether one of the two submaps is known to have been deleted, or to have had its landmarks changed, since the match. The formats g2o and matrices leave stale constraints out.
             */
            stale: boolean;
            /**
             * To
             * @description Id of the submap whose points the transform takes.
             */
            to: string;
            /**
             * To Revision
             * @description Revision of the collection at which the landmarks of `to` were stored. Null in older results.
             */
            to_revision: number | null;
            /**
             * To Session
             * @description Session of the submap `to`. Null if it has none.
             */
            to_session: string | null;
            /** @description from_T_to: p_from = R(yaw) p_to + (x, y). */
            transform: components["schemas"]["ConstraintTransform"];
            /**
             * Warnings
             * @description What is wrong with the coordinates of one side, as stable words. The covariance is widened accordingly. `tilted`: one direction is longer than the other on one side: a sensor was tilted, or drifted along a line; `scaled`: one side is larger than the other: a unit, a range calibration or a map's scale is off; `bent`: one side is bent: it was gathered along a trajectory that drifted; `far_origin`: the query's origin is far from its trees: use the covariance about their middle (`middle`).
             */
            warnings?: string[];
        };
        /**
         * ConstraintExclude
         * @description Pairs of submaps to leave out. If both members are given, only pairs for which both hold are left out.
         */
        ConstraintExclude: {
            /**
             * Same Session
             * @description Leave out pairs of the same session. With `within_seconds`, only those that are also that close in time.
             */
            same_session?: boolean | null;
            /**
             * Within Seconds
             * @description Leave out pairs whose stamps differ by at most this many seconds. With `same_session`, only those of the same session. A submap without a stamp is paired with every other.
             */
            within_seconds?: number | null;
        };
        /**
         * ConstraintGates
         * @description What an accepted match must also pass to become a constraint.
         */
        ConstraintGates: {
            /**
             * Confidence
             * @description Least confidence that a match must have to become a constraint.
             */
            confidence?: number | null;
            /**
             * Inlier Count
             * @description Fewest inliers that a match must have to become a constraint.
             */
            inlier_count?: number | null;
            /**
             * Rms
             * @description Largest root mean square of the inliers' residuals, in metres, that a match may have to become a constraint.
             */
            rms?: number | null;
        };
        /**
         * ConstraintList
         * @description The constraints that a job found.
         */
        ConstraintList: {
            /**
             * Constraints
             * @description The constraints, at most one for each pair of submaps.
             */
            constraints: components["schemas"]["Constraint"][];
        };
        /**
         * ConstraintPage
         * @description Constraints in the order they were stored.
         */
        ConstraintPage: {
            /**
             * Constraints
             * @description The constraints.
             */
            constraints: components["schemas"]["KeptConstraint"][];
            /**
             * Next
             * @description Cursor of the next page. The last page does not have this member.
             */
            next?: string | null;
        };
        /**
         * ConstraintsInput
         * @description Which submaps to look up, in which others, and which matches become constraints.
         */
        ConstraintsInput: {
            /**
             * Bbox
             * @description Look up only submaps whose footprint reaches into this box: [min x, min y, max x, max y], in metres in the map frame.
             */
            bbox?: number[] | null;
            /**
             * Changed Only
             * @description Look up only submaps that are new, or whose landmarks changed, since an earlier job with the same `gates`, `exclude` and `per_submap` looked them up. Constraints that it found are kept.
             */
            changed_only?: boolean | null;
            /**
             * Datetime
             * @description Look up only submaps with a stamp in this interval, such as `2026-05-04T00:00:00Z/2026-05-05T00:00:00Z`; `..` leaves an end open.
             */
            datetime?: string | null;
            /** @description Pairs of submaps to leave out. */
            exclude?: components["schemas"]["ConstraintExclude"] | null;
            /**
             * Frame Id
             * @description Look up only submaps that have a pose in this map frame.
             */
            frame_id?: string | null;
            /** @description What an accepted match must also pass to become a constraint. */
            gates?: components["schemas"]["ConstraintGates"] | null;
            /**
             * Per Submap
             * @description Most constraints from one submap that is looked up.
             */
            per_submap?: number | null;
            /**
             * Session
             * @description Look up only the submaps of this session. They are compared with all submaps.
             */
            session?: string | null;
            /**
             * Submap Ids
             * @description Look up only the submaps with these ids. They are compared with all submaps.
             */
            submap_ids?: string[] | null;
        };
        /**
         * ConstraintTransform
         * @description from_T_to: the pose of the frame of `to` in the frame of `from`.
         */
        ConstraintTransform: {
            /**
             * About
             * @description The point that `covariance` is about: the origin of the frame of the submap `to`.
             * @default to_origin
             * @constant
             */
            about: "to_origin";
            /**
             * Covariance
             * @description Covariance of the position of the point `about`, along the axes of `covariance_frame`, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. Null if it is unknown.
             */
            covariance: number[] | null;
            /**
             * Covariance Frame
             * @description Axes of `covariance`: those of the frame of the submap `from`.
             * @default from
             * @constant
             */
            covariance_frame: "from";
            /** @description The uncertainty about the middle of the trees that both submaps have. */
            middle: components["schemas"]["TreesMiddle"];
            /**
             * X
             * @description Translation along x, in metres, in the frame that the transform takes points to.
             */
            x: number;
            /**
             * Y
             * @description Translation along y, in metres, in the frame that the transform takes points to.
             */
            y: number;
            /**
             * Yaw
             * @description Rotation in radians, counter-clockwise.
             */
            yaw: number;
        };
        /**
         * Counts
         * @description How much a collection contains.
         */
        Counts: {
            /**
             * Landmarks
             * @description Number of landmarks in all submaps. A tree counts in each of them.
             */
            landmarks: number;
            /**
             * Polygons
             * @description Number of interior Urquhart polygons in all submaps.
             */
            polygons: number;
            /**
             * Submaps
             * @description Number of submaps.
             */
            submaps: number;
        };
        /**
         * Exclude
         * @description Submaps to leave out of the search: those of `submap_ids`, and those for which all other given members hold.
         *
         *     `{"session": "mine", "within_seconds": 60}` leaves out the last minute of the session `mine`, and no other submaps.
         */
        Exclude: {
            /**
             * Session
             * @description Leave out the submaps of this session. With `within_seconds`, only those that are also that close in time.
             */
            session?: string | null;
            /**
             * Submap Ids
             * @description Ids of submaps to leave out. Unknown ids are ignored.
             */
            submap_ids?: string[] | null;
            /**
             * Within Seconds
             * @description Leave out submaps whose stamp differs from the query's by at most this many seconds. The query must have a `stamp`. With `session`, only submaps of that session.
             */
            within_seconds?: number | null;
        };
        /**
         * ExplanationAnswer
         * @description Why a stored answer has its verdict.
         */
        ExplanationAnswer: {
            /**
             * Collection
             * @description Id of the collection.
             */
            collection: string;
            /**
             * Findings
             * @description What each level of the search found, level by level, best first. Null if an older version stored the answer without findings.
             */
            findings: components["schemas"]["FindingAnswer"][] | null;
            /**
             * Findings Total
             * @description Number of findings, of which `findings` lists the strongest. Null if `findings` is null.
             */
            findings_total: number | null;
            /** @description What a pose had to pass to be `matched`. */
            gates: components["schemas"]["GatesAnswer"];
            /**
             * Lead
             * @description Evidence of the best pose minus that of its strongest rival. Null if no other pose was strong enough to compare.
             */
            lead: number | null;
            /** @description Paths that belong to the explanation. */
            links: components["schemas"]["ExplanationLinks"];
            /**
             * Query Id
             * @description Id of the stored query.
             */
            query_id: string;
            /**
             * Reason
             * @description Why this verdict, as a stable word. `verified`: chance and every rival pose are ruled out; `below_gate`: too little to rule out chance or trees in rows; `rival_too_close`: another pose cannot be ruled out; `outside_prior`: the place seems to lie outside of the prior; `contradicting_maps`: submaps that fit have contradicting map poses; `verification_failed`: more trees speak against the pose than for it; `no_proposal`: no submap has anything like these trees; `empty_collection`: there is no submap to look in; `all_filtered_out`: all submaps are excluded, or none is near; `too_few_landmarks`: fewer than three trees fix no pose; `collinear_landmarks`: trees on one line fix no pose; `deadline`: the time ran out before the search was complete; `angle_unit`: the azimuths fit in gon, not in degrees.
             */
            reason: string;
            /**
             * Rivals
             * @description Other poses that explain so many of the trees that they are not ruled out, strongest first.
             */
            rivals: components["schemas"]["RivalAnswer"][];
            /** @description Why the search ended and what its limits left out. Null in answers that an older version stored. */
            search?: components["schemas"]["SearchAnswer"] | null;
            /**
             * Sentences
             * @description The meaning of each reason, `refused` and warning in this explanation, by its word.
             */
            sentences: {
                [key: string]: string;
            };
            /**
             * Stages
             * @description What each stage of the search did, in order.
             */
            stages: components["schemas"]["StageAnswer"][];
            /**
             * Verdict
             * @description The outcome. Decide by it: `matched`, `ambiguous` or `no_match`.
             * @enum {string}
             */
            verdict: "matched" | "ambiguous" | "no_match";
        };
        /**
         * ExplanationLinks
         * @description Paths that belong to an explanation.
         */
        ExplanationLinks: {
            /**
             * Query
             * @description Path of the stored answer.
             */
            query: string;
            /**
             * Self
             * @description Path of this explanation.
             */
            self: string;
        };
        /**
         * Extent
         * @description The area and the time that a collection covers.
         */
        Extent: {
            /**
             * Spatial
             * @description The area covered, one entry for each map frame. Empty if no submap has a `map_pose`.
             */
            spatial: components["schemas"]["SpatialExtent"][];
            /**
             * Temporal
             * @description Earliest and latest `stamp` of the submaps. Null if no submap has one.
             */
            temporal: string[] | null;
        };
        /**
         * FieldProblem
         * @description One fault in a request.
         */
        FieldProblem: {
            /**
             * Code
             * @description The type of fault, as a stable word for programs.
             */
            code: string;
            /**
             * Detail
             * @description What is wrong and what to do.
             */
            detail: string;
            /**
             * Indices
             * @description Positions of the landmarks at fault in the list that was sent, counted from 0.
             * @default null
             */
            indices: number[] | null;
            /**
             * Parameter
             * @description Name of the path, query or header parameter that is at fault, if it is not in the body.
             * @default null
             */
            parameter: string | null;
            /**
             * Pointer
             * @description JSON pointer (RFC 6901) to the member of the body that is at fault.
             * @default null
             */
            pointer: string | null;
        };
        /**
         * FileRows
         * @description The rows of a file of trees: how many were read, and how many of them gave no tree.
         */
        FileRows: {
            /**
             * Further Stems
             * @description Number of rows left out because a thicker stem of the same tree is there.
             */
            further_stems: number;
            /**
             * Merged
             * @description Number of trees left out because a thicker tree is within 1 cm.
             */
            merged: number;
            /**
             * Read
             * @description Number of rows, without those that options such as `only` and `keep` exclude.
             */
            read: number;
            /**
             * Skipped
             * @description Number of rows left out because they cannot be used, with `skip_bad`.
             */
            skipped: number;
        };
        /**
         * FindingAnswer
         * @description What one level of the search found in one submap, before it was compared with rivals.
         */
        FindingAnswer: {
            /**
             * Evidence
             * @description Natural logarithm of how much likelier the trees of both sides are if this is the same place than if they agree by chance, over all landmarks.
             */
            evidence: number;
            /**
             * Inlier Count
             * @description Number of pairs of landmarks that agree under the transform.
             */
            inlier_count: number;
            /**
             * Level
             * @description The step of the search that proposed the pose: matching `quads`, matching `polygons`, an `exhaustive` trial of rotations and shifts, or the `paper`'s method. `given`: a pose of the window of a given `prior`.
             * @enum {string}
             */
            level: "polygons" | "quads" | "exhaustive" | "paper" | "given";
            /**
             * Log Odds
             * @description `evidence` minus the natural logarithm of the number of poses that there were to choose from, and minus 0.1 for each landmark of the overlap.
             */
            log_odds: number;
            /**
             * Overlap Count
             * @description Number of the query's landmarks inside the overlap of both footprints, or of the submap's if those are more.
             */
            overlap_count: number;
            /**
             * Refused
             * @description Why this finding is not accepted, as a stable word: one of those of `reason`. Null if only a rival could refuse it.
             */
            refused: string | null;
            /**
             * Submap Id
             * @description Id of the submap.
             */
            submap_id: string;
            /**
             * Support
             * @description How many quads or polygons agree on this pose or, if `level` is `exhaustive`, how many shifts and rotations stood out. Not comparable between levels.
             */
            support: number;
        };
        /**
         * GatesAnswer
         * @description What a pose must pass to be `matched`, from the query's `min_confidence` and the collection's configuration.
         *
         *     Against a rival, the lead must be at least `lead` + `lead_per_landmark` * (landmarks of the overlap) +
         *     `lead_ratio` * (evidence of the rival).
         */
        GatesAnswer: {
            /**
             * Confidence
             * @description Least confidence that is `matched`: the query's `min_confidence`, or that of the collection's `gate`, with the probability of an error rounded to two digits.
             */
            confidence: number;
            /**
             * Lead
             * @description Constant part of the lead in evidence that a pose needs over its strongest rival. `lead_per_landmark` and `lead_ratio` are added to it.
             */
            lead: number;
            /**
             * Lead Per Landmark
             * @description Lead in evidence needed for each landmark of the overlap, added to `lead`. It is the parameter of the same name in the collection's `config`.
             */
            lead_per_landmark: number;
            /**
             * Lead Ratio
             * @description Lead in evidence needed as a share of the rival's evidence, added to `lead`.
             */
            lead_ratio: number;
            /**
             * Log Odds
             * @description Least `log_odds` with which a pose without rivals reaches that confidence. With a rival, more is needed: the odds of an error by chance and of one by a rival add up.
             */
            log_odds: number;
        };
        /**
         * HintAnswer
         * @description What is probably wrong with the query's coordinates: it would be `matched` without it.
         */
        HintAnswer: {
            /**
             * Factor
             * @description Number by which the query's coordinates must be multiplied; 1 if only an axis is reversed.
             */
            factor: number;
            /**
             * Inlier Count
             * @description Number of pairs of landmarks that then agree.
             */
            inlier_count: number;
            /**
             * Sentence
             * @description The hint in words.
             */
            sentence: string;
            /**
             * Submap Id
             * @description Id of the submap that it then matches.
             */
            submap_id: string;
            /**
             * Word
             * @description What is wrong, as a stable word. `mirrored`: an axis or the direction of angles is reversed; `feet`: the query is in feet; `metres`: the map is in feet; `mercator`: one side is in Web Mercator; `scaled`: one side is larger.
             * @enum {string}
             */
            word: "mirrored" | "feet" | "metres" | "mercator" | "scaled";
        };
        /**
         * Inlier
         * @description A landmark of the query and a landmark of the submap that are the same tree under the transform.
         */
        Inlier: {
            /**
             * Query
             * @description Id of the query's landmark. Ids are always strings: a landmark that was sent without an id has its position in the list as text, counted from 0 ("0", "1", ...).
             */
            query: string;
            /**
             * Residual
             * @description Distance between the two landmarks under the transform, in metres.
             */
            residual: number;
            /**
             * Submap
             * @description Id of the submap's landmark. Ids are always strings: a landmark that was sent without an id has its position in the list as text, counted from 0 ("0", "1", ...).
             */
            submap: string;
        };
        /**
         * InlierColumns
         * @description Pairs of landmarks as three lists of one length: a quarter of the bytes that `inliers` takes.
         */
        InlierColumns: {
            /**
             * Query
             * @description Positions of the landmarks in the list of the query, counted from 0.
             */
            query: number[];
            /**
             * Residual
             * @description Distances between the two under the transform, in metres, rounded to a tenth of a millimetre.
             */
            residual: number[];
            /**
             * Submap
             * @description Positions of their partners in the submap's list of landmarks.
             */
            submap: number[];
        };
        /**
         * JobAnswer
         * @description A job: long work that goes on after the request that asked for it.
         */
        JobAnswer: {
            /**
             * Collection
             * @description Id of the collection that the job works on.
             */
            collection: string;
            /**
             * Counts
             * @description Number of lines, submaps or plots by outcome.
             */
            counts: {
                [key: string]: number;
            };
            /**
             * Created
             * @description When the job was accepted.
             */
            created: string;
            /**
             * Dismissed
             * @description Whether somebody dismissed the job. It may still have to stop.
             */
            dismissed: boolean;
            /**
             * Done
             * @description Number of lines, submaps or plots that were worked on.
             */
            done: number;
            /**
             * Eta Seconds
             * @description Estimated seconds until the job ends, from its pace so far. Null while there is no estimate.
             */
            eta_seconds: number | null;
            /**
             * Finished
             * @description When the job ended. Null before.
             */
            finished: string | null;
            /**
             * Id
             * @description Id of the job.
             */
            id: string;
            /** @description Paths of the job, its results and its collection. */
            links: components["schemas"]["JobLinks"];
            /**
             * Problem
             * @description Why the job failed, or why the operator ended it: a problem document. Null otherwise.
             */
            problem: {
                [key: string]: unknown;
            } | null;
            /**
             * Started
             * @description When the job began to work. Null before.
             */
            started: string | null;
            /**
             * State
             * @description How far the job is. `accepted`: it waits for a turn, its first or its next one. `running`: it works. `successful`, `failed` and `dismissed` are final.
             */
            state: string;
            /**
             * Total
             * @description Number of lines, submaps or plots to work on. Null while it is unknown.
             */
            total: number | null;
            /**
             * Type
             * @description What the job does: `import`, `reindex`, `constraints`, `map` or `coregistration`.
             */
            type: string;
        };
        /**
         * JobFile
         * @description A file that a job wrote.
         */
        JobFile: {
            /**
             * Bytes
             * @description Size of the file, in bytes.
             */
            bytes: number;
            /**
             * Href
             * @description Path to download the file from.
             */
            href: string;
            /**
             * Media Type
             * @description Media type of the file.
             */
            media_type: string;
            /**
             * Name
             * @description Name of the file, with its folder: `plots.csv`, `pictures/P1.svg`.
             */
            name: string;
        };
        /**
         * JobFileList
         * @description The files that a job wrote.
         */
        JobFileList: {
            /**
             * Files
             * @description The files, in the order of their names.
             */
            files: components["schemas"]["JobFile"][];
        };
        /**
         * JobLinks
         * @description Paths of a job, its results and its collection.
         */
        JobLinks: {
            /**
             * Collection
             * @description Path of the collection that the job works on.
             */
            collection: string;
            /**
             * Errors
             * @description Path of the lines that the job refused.
             */
            errors: string;
            /**
             * Files
             * @description Path of the list of files that the job writes. Null for a type of job that writes none.
             */
            files?: string | null;
            /**
             * Results
             * @description Path of the job's results.
             */
            results: string;
            /**
             * Self
             * @description Path of the job.
             */
            self: string;
        };
        /**
         * JobPage
         * @description A page of jobs.
         */
        JobPage: {
            /**
             * Jobs
             * @description The jobs of the page, newest first.
             */
            jobs: components["schemas"]["JobAnswer"][];
            /**
             * Next
             * @description Cursor of the next page. The last page does not have this member.
             */
            next?: string | null;
        };
        /**
         * KeptConstraint
         * @description A constraint that the collection keeps: from_T_to takes points of `to` into the frame of `from`.
         */
        KeptConstraint: {
            /**
             * Confidence
             * @description Calibrated probability that `transform` is right. Null for odometry.
             */
            confidence?: number | null;
            /**
             * Created
             * @description When it was stored, in RFC 3339 form.
             */
            created: string;
            /**
             * From
             * @description Id of the submap whose frame the transform takes points to.
             */
            from: string;
            /**
             * From Revision
             * @description Revision of the collection at which the landmarks of `from` were stored that the constraint is of.
             */
            from_revision: number;
            /**
             * Id
             * @description Id of the constraint in its collection. It is not given out again.
             */
            id: string;
            /**
             * Information
             * @description Information matrix of the edge, as pose graphs use it: 3x3, row-major over (x, y, yaw), of the error log(measured^-1 true), about the origin of the frame of `to`, along the axes of that frame.
             */
            information: number[];
            /**
             * Information Frame
             * @description Axes of `information`.
             * @default to
             * @constant
             */
            information_frame: "to";
            /**
             * Inlier Count
             * @description Number of pairs of landmarks that agree. Null for odometry.
             */
            inlier_count?: number | null;
            /**
             * Job
             * @description Id of the job that found it. Null if it was posted, or if a command found it.
             */
            job: string | null;
            /**
             * Kind
             * @description Whether a search found it, or a robot measured it while it drove.
             * @enum {string}
             */
            kind: "match" | "odometry";
            /**
             * Rank
             * @description Rank of the match in its search. Null for odometry.
             */
            rank?: number | null;
            /**
             * Refused
             * @description Why the last map left it out. Null if it did not, or no map used it.
             */
            refused: ("contradicted" | "unconfirmed" | "undecided") | null;
            /**
             * Refused By
             * @description Id of that map.
             */
            refused_by: string | null;
            /**
             * Rms
             * @description Root mean square of the inliers' residuals, in metres. Null for odometry.
             */
            rms?: number | null;
            /**
             * Source
             * @description Whether a job found it, or a client posted it.
             * @enum {string}
             */
            source: "job" | "posted";
            /**
             * State
             * @description `stale`: a submap was deleted or has other landmarks since; a job finds the constraint again. `refused`: the last map that used it left it out. Maps use `active` and `refused` ones, and judge each again.
             * @enum {string}
             */
            state: "active" | "stale" | "refused";
            /**
             * To
             * @description Id of the submap whose points the transform takes.
             */
            to: string;
            /**
             * To Revision
             * @description The same for `to`.
             */
            to_revision: number;
            /** @description from_T_to: p_from = R(yaw) p_to + (x, y). */
            transform: components["schemas"]["ConstraintTransform"];
        };
        /**
         * KeyframeBody
         * @description One view of a sequence: its trees in a frame of its own, and where that lies in the frame of the query.
         */
        KeyframeBody: {
            /**
             * Ids
             * @description Ids of the trees in `xy`, one for each. By default their positions in the list as text, counted from 0.
             */
            ids?: string[] | null;
            /**
             * Landmarks
             * @description The trees, each with its position, attributes and id. The alternative to `xy`.
             */
            landmarks?: components["schemas"]["Landmark"][] | null;
            /** @description Pose of the keyframe in the frame of the query. */
            pose: components["schemas"]["KeyframePose"];
            /**
             * Xy
             * @description Positions of the trees as [x, y], in metres. The alternative to `landmarks`.
             */
            xy?: number[][] | null;
        };
        /**
         * KeyframePose
         * @description Pose of a keyframe in the frame of the query, such as that of the odometry: p_query = R(yaw) p + (x, y).
         */
        KeyframePose: {
            /**
             * X
             * @description Position of the keyframe's origin along the x axis of the query, in metres.
             */
            x: number;
            /**
             * Y
             * @description Position of the keyframe's origin along the y axis of the query, in metres.
             */
            y: number;
            /**
             * Yaw
             * @description Rotation from the axes of the keyframe to those of the query, in radians, counter-clockwise.
             */
            yaw: number;
        };
        /**
         * Landmark
         * @description A tree.
         */
        Landmark: {
            /**
             * Dbh Cm
             * @description Diameter at breast height, in centimetres, from 1 to 500. It counts as evidence where both sides have it, and is never required.
             */
            dbh_cm?: number | null;
            /**
             * Height M
             * @description Height of the tree, in metres, up to 150.
             */
            height_m?: number | null;
            /**
             * Id
             * @description Id of the tree, unique in the submap. By default its position in the list as text, counted from 0.
             */
            id?: string | null;
            /**
             * Species
             * @description Species of the tree: any name or code.
             */
            species?: string | null;
            /**
             * X
             * @description Position along x, in metres, in the frame of the submap or query.
             */
            x: number;
            /**
             * Y
             * @description Position along y, in metres, in the frame of the submap or query.
             */
            y: number;
        };
        /**
         * LandmarkEntry
         * @description A tree of the map.
         */
        LandmarkEntry: {
            /**
             * Covariance
             * @description Covariance of the position: 2x2, row-major, in square metres.
             */
            covariance: number[];
            /**
             * Dbh Cm
             * @description Median of the diameters at breast height, in centimetres.
             */
            dbh_cm: number | null;
            /**
             * First Seen
             * @description The earliest stamp of the submaps that have it, in RFC 3339 form.
             */
            first_seen: string | null;
            /**
             * Height M
             * @description Median of the heights, in metres.
             */
            height_m: number | null;
            /**
             * Id
             * @description Number of the tree, from 1.
             */
            id: number;
            /**
             * Last Seen
             * @description The latest stamp of the submaps that have it, in RFC 3339 form.
             */
            last_seen: string | null;
            /**
             * Missed
             * @description Number of submaps that have other trees all around it, but not this one.
             */
            missed: number;
            /**
             * Observed
             * @description Number of submaps that have the tree.
             */
            observed: number;
            /**
             * Part
             * @description Number of the part of the map that it belongs to.
             */
            part: number;
            /**
             * X
             * @description Metres, in the frame of the part.
             */
            x: number;
            /**
             * Y
             * @description Metres, in the frame of the part.
             */
            y: number;
        };
        /**
         * LimitsAnswer
         * @description The limits that requests must keep. An error names the limit that was exceeded as it is named here.
         */
        LimitsAnswer: {
            /**
             * Limits
             * @description Each limit by its name.
             */
            limits: {
                [key: string]: number;
            };
            /**
             * Rates
             * @description Requests per second that a key, or an address without a key, may send (`requests_per_second`). Empty if there is no such limit.
             */
            rates: {
                [key: string]: number;
            };
            /** @description How long stored queries and answers are kept. */
            retention: components["schemas"]["Retention"];
            versions: components["schemas"]["Versions"];
        };
        /**
         * LineResult
         * @description The result of one line of an import, as a line of NDJSON. Members that do not apply are left out.
         */
        LineResult: {
            /**
             * Id
             * @description Id of the submap. Left out if the line has none that can be used.
             * @default null
             */
            id: string | null;
            /**
             * Last Line
             * @description Number of the last of the refused lines that this one stands for. `line` is the first.
             * @default null
             */
            last_line: number | null;
            /**
             * Line
             * @description Number of the line in the upload, counted from 1.
             */
            line: number;
            /**
             * Lines
             * @description Number of refused lines that this one stands for, if they are only counted.
             * @default null
             */
            lines: number | null;
            /**
             * Outcome
             * @description What was done. `skipped`: the id was taken (`on_conflict=skip`), or another line was refused (`mode=all`).
             * @enum {string}
             */
            outcome: "created" | "replaced" | "unchanged" | "skipped" | "refused";
            /**
             * Problem
             * @description Why the line was refused: a problem document, shortened if very many lines are refused.
             * @default null
             */
            problem: {
                [key: string]: unknown;
            } | null;
            /**
             * Revision
             * @description Revision of the collection at the last write of the submap.
             * @default null
             */
            revision: number | null;
        };
        /**
         * Liveness
         * @description Answer of a process that is alive.
         */
        Liveness: {
            /**
             * Status
             * @description Always `ok`.
             */
            status: string;
        };
        /**
         * Load
         * @description How busy the answering process is.
         */
        Load: {
            /**
             * Capacity
             * @description Number of requests that can be in progress at once.
             */
            capacity: number;
            /**
             * In Flight
             * @description Number of requests in progress.
             */
            in_flight: number;
            /**
             * Queued
             * @description Number of requests that wait for a place.
             */
            queued: number;
            /**
             * Saturated
             * @description Whether all places are taken, so that another caller's request has to wait.
             */
            saturated: boolean;
        };
        /**
         * MapAnswer
         * @description A map that a job built.
         */
        MapAnswer: {
            /**
             * Constraints
             * @description What became of each constraint.
             */
            constraints: components["schemas"]["MapEdge"][];
            /**
             * Contradictions
             * @description Odometry that other constraints contradict. While one of them is `undecided`, the poses cannot be applied.
             */
            contradictions: components["schemas"]["MapContradiction"][];
            /**
             * Id
             * @description Id of the map: that of the job that built it.
             */
            id: string;
            /**
             * Map Version
             * @description Revision of the collection under which all poses were written. Null if they were not.
             */
            map_version: number | null;
            /**
             * Poses
             * @description The pose of each submap.
             */
            poses: components["schemas"]["MapSubmapPose"][];
            /** @description The map in numbers. */
            summary: components["schemas"]["MapSummary"];
        };
        /**
         * MapContradiction
         * @description Odometry that other constraints contradict.
         */
        MapContradiction: {
            /**
             * Against
             * @description Positions in `constraints` of those that contradict them and agree with each other. Empty if the odometry contradicts itself.
             */
            against: number[];
            /**
             * Distance
             * @description How far both sides are apart, in standard deviations: the Mahalanobis distance.
             */
            distance: number;
            /**
             * Odometry
             * @description Positions in `constraints`, from 0: odometry edges, of which at least one is wrong, or else `against` is.
             */
            odometry: number[];
            /**
             * Outcome
             * @description `refused`: the odometry was left out. `undecided`: nothing tells which side is wrong, and the poses are not applied.
             * @enum {string}
             */
            outcome: "refused" | "undecided";
            /**
             * Witnesses
             * @description How many ways through the constraints contradict the odometry and have no submap in common.
             */
            witnesses: number;
        };
        /**
         * MapEdge
         * @description What became of one constraint.
         */
        MapEdge: {
            /**
             * Distance
             * @description The same in standard deviations: the Mahalanobis distance. 4 is beyond the gate.
             */
            distance: number | null;
            /**
             * From
             * @description Id of the submap whose frame the constraint is in. Null for a prior.
             */
            from: string | null;
            /**
             * Id
             * @description Id of the constraint if the collection keeps it. Null for priors and odometry of the map.
             */
            id?: string | null;
            /**
             * Kind
             * @description Where the constraint comes from.
             * @enum {string}
             */
            kind: "match" | "odometry" | "prior";
            /**
             * Refused
             * @description Why the constraint was left out: other constraints contradict it (`contradicted`), nothing confirms it (`unconfirmed`), or it is odometry that contradicts other odometry, and nothing tells which of them is wrong (`undecided`). Null if it was used.
             */
            refused: ("contradicted" | "unconfirmed" | "undecided") | null;
            /**
             * Shift
             * @description Metres between the constraint and the poses of the map. Null between parts that nothing connects.
             */
            shift: number | null;
            /**
             * Support
             * @description Number of other constraints that confirm it in short cycles.
             */
            support: number;
            /**
             * To
             * @description Id of the submap whose pose it gives.
             */
            to: string;
            /**
             * Turn
             * @description The same for the yaw, in radians, from 0 to pi.
             */
            turn: number | null;
        };
        /**
         * MapFrame
         * @description Where a map frame is on Earth.
         */
        MapFrame: {
            /**
             * Crs
             * @description Projected coordinate reference system of the frame, in metres, such as `EPSG:32633`.
             */
            crs: string;
            /**
             * Origin
             * @description Easting and northing, in metres, of the frame's origin in the CRS. Leave it out if poses are in full coordinates of the CRS.
             */
            origin?: number[] | null;
        };
        /**
         * MapInput
         * @description Which submaps become a map, which matches between them count, and what to do with the poses.
         */
        MapInput: {
            /**
             * Agreeing
             * @description Matches that must agree before one is believed. With 1, a match is believed that nothing confirms and nothing contradicts.
             */
            agreeing?: number | null;
            /**
             * Apply
             * @description Write the poses into the submaps, all in one transaction.
             */
            apply?: boolean | null;
            /**
             * Association
             * @description How trees of several submaps become one: `joint` moves each submap as a whole, `dbscan` groups trees within 0.5 m, as in the paper.
             */
            association?: ("joint" | "dbscan") | null;
            /**
             * Bbox
             * @description Look up only submaps whose footprint reaches into this box: [min x, min y, max x, max y], in metres in the map frame.
             */
            bbox?: number[] | null;
            /**
             * Changed Only
             * @description Look up only submaps that are new, or whose landmarks changed, since an earlier job with the same `gates`, `exclude` and `per_submap` looked them up. With false, all chosen submaps are looked up again.
             */
            changed_only?: boolean | null;
            /**
             * Datetime
             * @description Look up only submaps with a stamp in this interval, such as `2026-05-04T00:00:00Z/2026-05-05T00:00:00Z`; `..` leaves an end open.
             */
            datetime?: string | null;
            /** @description Pairs of submaps to leave out. */
            exclude?: components["schemas"]["ConstraintExclude"] | null;
            /**
             * Frame Id
             * @description Look up only submaps that have a pose in this map frame.
             */
            frame_id?: string | null;
            /** @description What an accepted match must also pass to become a constraint. */
            gates?: components["schemas"]["ConstraintGates"] | null;
            /**
             * Map Frame Id
             * @description Map frame of the poses. Parts of the map that nothing connects get frames of their own: the largest one this name, others this name with `.2`, `.3` and so on. With `use_map_poses`, the part with the priors is in their frame.
             */
            map_frame_id?: string | null;
            /**
             * Odometry
             * @description Relative poses for this map alone, besides the odometry that the collection keeps. They are believed within their covariances, unless several independent matches contradict one of them, or they contradict each other.
             */
            odometry?: components["schemas"]["OdometryEdge"][] | null;
            /**
             * Per Submap
             * @description Most constraints from one submap that is looked up.
             */
            per_submap?: number | null;
            /**
             * Session
             * @description Look up only the submaps of this session. They are compared with all submaps.
             */
            session?: string | null;
            /**
             * Sessions
             * @description Only submaps of these sessions.
             */
            sessions?: string[] | null;
            /**
             * Submap Ids
             * @description Look up only the submaps with these ids. They are compared with all submaps.
             */
            submap_ids?: string[] | null;
            /**
             * Use Map Poses
             * @description Use the map poses of the submaps that have a covariance, such as those of GNSS, as priors. They must all be in one map frame. Poses that an earlier map wrote are no new evidence: do not use those.
             */
            use_map_poses?: boolean | null;
        };
        /**
         * MapPose
         * @description Pose of a submap's frame in a map: p_map = R(yaw) p_submap + (x, y).
         */
        MapPose: {
            /**
             * About
             * @description The point that `covariance` is about. Ignored: it is accepted so that the `map_pose` of a candidate can be posted unchanged.
             */
            about?: ("submap_origin" | "query_origin") | null;
            /**
             * Covariance
             * @description Covariance of the position of the submap's origin, along the map's axes, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. It must be symmetric and positive semidefinite. Null if it is unknown.
             */
            covariance?: number[] | null;
            /**
             * Covariance Frame
             * @description Axes of `covariance`: always the map's. Accepted because poses in answers have it.
             */
            covariance_frame?: "map" | null;
            /**
             * Frame Id
             * @description Name of the map's frame.
             */
            frame_id?: string | null;
            /** @description Uncertainty about the middle of the trees. Ignored: it is accepted so that the `map_pose` of a candidate can be posted unchanged. Only `covariance` is stored. */
            middle?: components["schemas"]["TreesMiddle"] | null;
            /**
             * X
             * @description Position of the submap's origin along the map's x axis, in metres from the map frame's origin. East if the map is geographic.
             */
            x: number;
            /**
             * Y
             * @description Position of the submap's origin along the map's y axis, in metres from the map frame's origin. North if the map is geographic.
             */
            y: number;
            /**
             * Yaw
             * @description Rotation from the submap's axes to the map's, in radians, counter-clockwise, from -2 pi to 2 pi.
             */
            yaw: number;
        };
        /**
         * MapPoseAnswer
         * @description Pose of the query's frame in the map that the submap has a pose in: p_map = R(yaw) p_query + (x, y).
         */
        MapPoseAnswer: {
            /**
             * About
             * @description The point that `covariance` is about: the origin of the query's frame.
             * @default query_origin
             * @constant
             */
            about: "query_origin";
            /**
             * Covariance
             * @description Covariance of the position of the point `about`, along the axes of `covariance_frame`, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. Null if it is unknown.
             */
            covariance: number[] | null;
            /**
             * Covariance Frame
             * @description Axes of `covariance`: those of the map's frame.
             * @default map
             * @constant
             */
            covariance_frame: "map";
            /**
             * Frame Id
             * @description Name of the map's frame.
             */
            frame_id: string;
            /** @description The uncertainty about the middle of the inlier trees. Null if `covariance` is null. */
            middle?: components["schemas"]["TreesMiddle"] | null;
            /**
             * X
             * @description Translation along x, in metres, in the frame that the transform takes points to.
             */
            x: number;
            /**
             * Y
             * @description Translation along y, in metres, in the frame that the transform takes points to.
             */
            y: number;
            /**
             * Yaw
             * @description Rotation in radians, counter-clockwise.
             */
            yaw: number;
        };
        /**
         * MapSubmapPose
         * @description The pose of a submap in the map.
         */
        MapSubmapPose: {
            /**
             * Id
             * @description Id of the submap.
             */
            id: string;
            /** @description The pose. Null if nothing connects the submap with others that were chosen. */
            map_pose: components["schemas"]["PlacedPose"] | null;
            /**
             * Part
             * @description Number of the part that the submap belongs to, from 1; 1 is the largest one.
             */
            part: number;
            /**
             * Session
             * @description Session of the submap. Null if it has none.
             */
            session: string | null;
        };
        /**
         * MapSummary
         * @description A map in numbers.
         */
        MapSummary: {
            /**
             * Constraints
             * @description Number of constraints.
             */
            constraints: number;
            /**
             * Contradicted
             * @description Number of constraints left out because others contradict them.
             */
            contradicted: number;
            /**
             * Contradictions
             * @description Number of times that constraints contradict odometry.
             */
            contradictions: number;
            /**
             * Covariance Scale
             * @description What the covariances of matches were multiplied with, because their cycles are off by more.
             */
            covariance_scale: number;
            /**
             * Noise
             * @description Metres: standard deviation of one coordinate of one observed tree.
             */
            noise: number;
            /**
             * Parts
             * @description Number of submaps of each part of the map, the largest first.
             */
            parts: number[];
            /**
             * Submaps
             * @description Number of submaps that were chosen.
             */
            submaps: number;
            /**
             * Trees
             * @description Number of trees.
             */
            trees: number;
            /**
             * Unconfirmed
             * @description Number of constraints left out because nothing confirms them.
             */
            unconfirmed: number;
            /**
             * Undecided
             * @description Number of constraints left out because odometry contradicts itself, and nothing tells where it is wrong.
             */
            undecided: number;
        };
        /**
         * MatchAnswer
         * @description A candidate of a stored query, with the landmarks of both sides.
         */
        MatchAnswer: {
            /** @description The candidate, as in the answer. */
            candidate: components["schemas"]["CandidateAnswer"];
            /**
             * Query Id
             * @description Id of the stored query.
             */
            query_id: string;
            /**
             * Query Ids
             * @description Ids of the query's landmarks, in the order of `query_landmarks`.
             */
            query_ids: string[];
            /**
             * Query Landmarks
             * @description Positions of the query's landmarks as [x, y], in metres, in the query's frame.
             */
            query_landmarks: number[][];
            /**
             * Submap Ids
             * @description Ids of the submap's landmarks, in the order of `submap_landmarks`.
             */
            submap_ids: string[];
            /**
             * Submap Landmarks
             * @description Positions of the submap's landmarks as [x, y], in metres, in the submap's frame.
             */
            submap_landmarks: number[][];
        };
        /**
         * MergeAnswer
         * @description A merge that a job computed.
         */
        MergeAnswer: {
            /**
             * Id
             * @description Id of the merge: that of its job.
             */
            id: string;
            /**
             * Map Version
             * @description Revision of the collection under which the submaps moved. Null if they did not.
             */
            map_version: number | null;
            /**
             * Pairs
             * @description What became of each match between the frames.
             */
            pairs: components["schemas"]["MergePair"][];
            /** @description How the two frames lie to each other. */
            summary: components["schemas"]["MergeSummary"];
        };
        /**
         * MergeInput
         * @description Which map frame is laid onto which, by which matches, and whether its submaps move.
         */
        MergeInput: {
            /**
             * Apply
             * @description Write the poses of all submaps of `from` in the frame `to`, in one transaction.
             */
            apply?: boolean | null;
            /**
             * Changed Only
             * @description Look up only submaps of `from` that are new, or whose landmarks changed, since an earlier job with the same `gates` and `per_submap` looked them up.
             */
            changed_only?: boolean | null;
            /**
             * From
             * @description The map frame that is laid onto the other one.
             */
            from: string;
            /** @description What an accepted match must also pass to count. */
            gates?: components["schemas"]["ConstraintGates"] | null;
            /**
             * Per Submap
             * @description Most matches of one submap of `from`, those in its own frame included.
             */
            per_submap?: number | null;
            /**
             * To
             * @description The map frame that stays.
             */
            to: string;
        };
        /**
         * MergePair
         * @description A match between a submap of each frame.
         */
        MergePair: {
            /**
             * Distance
             * @description The same in standard deviations: the Mahalanobis distance.
             */
            distance: number;
            /**
             * From Submap
             * @description Id of the submap that has a pose in the frame `from`.
             */
            from_submap: string;
            /**
             * Id
             * @description Id of the constraint that the collection keeps.
             */
            id: string;
            /**
             * Refused
             * @description Why the match was left out: it disagrees with the pose that most agree on (`contradicted`), or too few agree to say (`unconfirmed`). Null if it was used.
             */
            refused: ("contradicted" | "unconfirmed") | null;
            /**
             * Shift
             * @description Metres between the match and the pose that most agree on, amid the trees.
             */
            shift: number;
            /**
             * To Submap
             * @description Id of the submap that has a pose in the frame `to`.
             */
            to_submap: string;
            /**
             * Turn
             * @description The same for the yaw, in radians, from 0 to pi.
             */
            turn: number;
        };
        /**
         * MergeSummary
         * @description How two map frames lie to each other.
         */
        MergeSummary: {
            /**
             * Agreeing
             * @description Matches that agree and have no submap in common.
             */
            agreeing: number;
            /**
             * From
             * @description The map frame that is laid onto the other one.
             */
            from: string;
            /**
             * Refused
             * @description Matches that were left out.
             */
            refused: number;
            /**
             * Submaps
             * @description Submaps that have a pose in the frame `from`.
             */
            submaps: number;
            /**
             * To
             * @description The map frame that stays.
             */
            to: string;
            /** @description to_T_from, the pose of the frame `from` in the frame `to`. Null unless `joined`. */
            transform: components["schemas"]["MergeTransform"] | null;
            /**
             * Used
             * @description Matches that agree.
             */
            used: number;
            /**
             * Verdict
             * @description `joined`: `transform` may be used. `undecided`: more than half as many matches agree on another pose. `unconnected`: fewer than 4 matches without a common submap agree.
             * @enum {string}
             */
            verdict: "joined" | "undecided" | "unconnected";
        };
        /**
         * MergeTransform
         * @description to_T_from: p_to = R(yaw) p_from + (x, y).
         */
        MergeTransform: {
            /**
             * About
             * @description The point that `covariance` is about: the origin of the frame `from`.
             * @default from_origin
             * @constant
             */
            about: "from_origin";
            /**
             * Covariance
             * @description Covariance of the position of the point `about`, along the axes of `covariance_frame`, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. Null if it is unknown.
             */
            covariance: number[] | null;
            /**
             * Covariance Frame
             * @description Axes of `covariance`: those of the frame `to`.
             * @default to
             * @constant
             */
            covariance_frame: "to";
            /** @description The uncertainty about the middle of the trees of all matches. */
            middle: components["schemas"]["TreesMiddle"];
            /**
             * X
             * @description Translation along x, in metres, in the frame that the transform takes points to.
             */
            x: number;
            /**
             * Y
             * @description Translation along y, in metres, in the frame that the transform takes points to.
             */
            y: number;
            /**
             * Yaw
             * @description Rotation in radians, counter-clockwise.
             */
            yaw: number;
        };
        /**
         * NamedSubmap
         * @description A submap with its id, as in an import.
         */
        NamedSubmap: {
            /**
             * Frame Id
             * @description Name of the frame that the landmarks' coordinates are in.
             */
            frame_id?: string | null;
            /**
             * Id
             * @description Id of the submap.
             */
            id: string;
            /**
             * Ids
             * @description Ids of the trees in `xy`, one for each. By default their positions in the list as text, counted from 0.
             */
            ids?: string[] | null;
            /**
             * Landmarks
             * @description The trees, each with its position, attributes and id. The alternative to `xy`.
             */
            landmarks?: components["schemas"]["Landmark"][] | null;
            /** @description Pose of the submap's frame in a map, if it is known. */
            map_pose?: components["schemas"]["MapPose"] | null;
            /**
             * Properties
             * @description Any other data that you want to store with the submap, as a JSON object.
             */
            properties?: {
                [key: string]: unknown;
            } | null;
            /**
             * Session
             * @description The drive, flight or survey that the submap belongs to.
             */
            session?: string | null;
            /**
             * Stamp
             * @description When the trees were observed, in RFC 3339 form with an offset. Stored to the microsecond; further digits are cut off.
             */
            stamp?: string | null;
            /**
             * Xy
             * @description Positions of the trees as [x, y], in metres. The alternative to `landmarks`.
             */
            xy?: unknown | null;
        };
        /**
         * Near
         * @description Roughly where in a map the query was observed. Only submaps near that point are searched.
         */
        Near: {
            /**
             * Frame Id
             * @description Name of the map's frame, as in `map_pose`.
             */
            frame_id?: string | null;
            /**
             * Radius
             * @description Largest distance, in metres along each axis, between the point and the footprint of a submap that is searched.
             */
            radius: number;
            /**
             * X
             * @description Position along the map's x axis, in metres, as in `map_pose`.
             */
            x: number;
            /**
             * Y
             * @description Position along the map's y axis, in metres, as in `map_pose`.
             */
            y: number;
        };
        /**
         * OdometryEdge
         * @description A relative pose that a robot measured while it drove: from_T_to. It is believed within its covariance, unless
         *     matches prove it wrong.
         */
        OdometryEdge: {
            /**
             * Covariance
             * @description Covariance of the position of the origin of `to`, along the axes of `from`, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. It must be positive definite.
             */
            covariance: number[];
            /**
             * From
             * @description Id of the submap whose frame the pose is in.
             */
            from: string;
            /**
             * To
             * @description Id of the submap whose pose it is.
             */
            to: string;
            /**
             * X
             * @description Position of the origin of `to` along the x axis of `from`, in metres.
             */
            x: number;
            /**
             * Y
             * @description Position of the origin of `to` along the y axis of `from`, in metres.
             */
            y: number;
            /**
             * Yaw
             * @description Rotation from the axes of `to` to those of `from`, in radians, counter-clockwise.
             */
            yaw: number;
        };
        /**
         * OdometryInput
         * @description Relative poses that a robot measured, which are all stored or none.
         */
        OdometryInput: {
            /**
             * Edges
             * @description The relative poses. One that is stored between the same two submaps, in either direction, is replaced.
             */
            edges: components["schemas"]["OdometryEdge"][];
        };
        /**
         * OdometryReceipt
         * @description Relative poses that were stored.
         */
        OdometryReceipt: {
            /**
             * Stored
             * @description Number of relative poses that were sent and are stored now.
             */
            stored: number;
        };
        /**
         * PartTrees
         * @description The trees of one part of a map.
         */
        PartTrees: {
            /**
             * Frame Id
             * @description Map frame of the positions.
             */
            frame_id: string;
            /**
             * Part
             * @description Number of the part, from 1.
             */
            part: number;
            /**
             * Trees
             * @description The trees.
             */
            trees: components["schemas"]["LandmarkEntry"][];
        };
        /**
         * PlacedPose
         * @description Pose of a stored submap's frame in a map: p_map = R(yaw) p_submap + (x, y).
         */
        PlacedPose: {
            /**
             * About
             * @description The point that `covariance` is about: the origin of the submap's frame.
             * @default submap_origin
             * @constant
             */
            about: "submap_origin";
            /**
             * Covariance
             * @description Covariance of the position of the point `about`, along the axes of `covariance_frame`, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. Null if it is unknown.
             */
            covariance: number[] | null;
            /**
             * Covariance Frame
             * @description Axes of `covariance`: those of the map's frame.
             * @default map
             * @constant
             */
            covariance_frame: "map";
            /**
             * Frame Id
             * @description Name of the map's frame.
             */
            frame_id: string;
            /**
             * X
             * @description Translation along x, in metres, in the frame that the transform takes points to.
             */
            x: number;
            /**
             * Y
             * @description Translation along y, in metres, in the frame that the transform takes points to.
             */
            y: number;
            /**
             * Yaw
             * @description Rotation in radians, counter-clockwise.
             */
            yaw: number;
        };
        /**
         * PlotRow
         * @description What a coregistration found for one plot, as a line of NDJSON: the row of the plot in `plots.csv`, where `east`
         *     is `E`, and `shift_east` is `dE`.
         *
         *     Lengths are in metres, but `east`, `north`, `x` and `y` are in the unit of their coordinate reference system.
         */
        PlotRow: {
            /**
             * Confidence
             * @description Calibrated probability that the pose is right.
             */
            confidence: number | null;
            /**
             * Crs
             * @description Coordinate reference system of the map. Null if it is not known.
             */
            crs: string | null;
            /**
             * East
             * @description Easting of the plot's centre in the map.
             */
            east: number | null;
            /**
             * File
             * @description Name of the file that the plot is from.
             */
            file: string;
            /**
             * Inliers
             * @description Number of these that have a partner in the map.
             */
            inliers: number | null;
            /**
             * Look At
             * @description Why somebody should look at the plot. Empty if nobody need.
             */
            look_at: string;
            /**
             * Map
             * @description Map frame that the plot lies in. Null unless it is matched.
             */
            map: string | null;
            /**
             * North
             * @description Northing of the plot's centre in the map.
             */
            north: number | null;
            /**
             * Places
             * @description Number of places that an ambiguous plot fits.
             */
            places: number | null;
            /**
             * Plot
             * @description Name of the plot.
             */
            plot: string;
            /**
             * Reason
             * @description Why, as a stable word.
             */
            reason: string;
            /**
             * Rival
             * @description Submap of the second of these places.
             */
            rival: string | null;
            /**
             * Rival East
             * @description Easting of that place.
             */
            rival_east: number | null;
            /**
             * Rival North
             * @description Northing of that place.
             */
            rival_north: number | null;
            /**
             * Rival Turn Cw Deg
             * @description Turn at that place, in degrees, clockwise.
             */
            rival_turn_cw_deg: number | null;
            /**
             * Rms
             * @description Root mean square of the distances between partners, in metres.
             */
            rms: number | null;
            /**
             * Scale
             * @description Factor by which the map is larger than the plot.
             */
            scale: number | null;
            /**
             * Searched
             * @description `near` if the plot was found where it ought to be, `everywhere` if not.
             * @enum {string}
             */
            searched: "" | "near" | "everywhere";
            /**
             * Sentence
             * @description What was found, in a sentence for people.
             */
            sentence: string;
            /**
             * Share
             * @description `inliers` divided by `trees`.
             */
            share: number | null;
            /**
             * Shift East
             * @description How far east the plot's own coordinates must be moved, in metres.
             */
            shift_east: number | null;
            /**
             * Shift North
             * @description How far north the plot's own coordinates must be moved, in metres.
             */
            shift_north: number | null;
            /**
             * Sigma East
             * @description Standard deviation of `east`, in metres.
             */
            sigma_east: number | null;
            /**
             * Sigma North
             * @description Standard deviation of `north`, in metres.
             */
            sigma_north: number | null;
            /**
             * Sigma Turn Deg
             * @description Standard deviation of the turn, in degrees.
             */
            sigma_turn_deg: number | null;
            /**
             * Trees
             * @description Number of trees of the plot.
             */
            trees: number;
            /**
             * Turn Cw Deg
             * @description Turn about the plot's centre, in degrees, clockwise.
             */
            turn_cw_deg: number | null;
            /**
             * Verdict
             * @description Verdict of the search. `not_read`: the plot cannot be read. `failed`: it cannot be looked up.
             * @enum {string}
             */
            verdict: "matched" | "ambiguous" | "no_match" | "not_read" | "failed";
            /**
             * X
             * @description The plot's centre in its own coordinates.
             */
            x: number | null;
            /**
             * Y
             * @description The plot's centre in its own coordinates.
             */
            y: number | null;
        };
        /**
         * PoseMove
         * @description A submap and its new pose.
         */
        PoseMove: {
            /**
             * Id
             * @description Id of the submap.
             */
            id: string;
            /**
             * If Match
             * @description ETag that the submap must have, without quotation marks. Null for any.
             */
            if_match?: string | null;
            /** @description The pose to write; null removes the pose that the submap has. */
            map_pose: components["schemas"]["MapPose"] | null;
        };
        /**
         * PosesAnswer
         * @description Poses that were written together.
         */
        PosesAnswer: {
            /**
             * Changed
             * @description Number of submaps whose pose is another one now.
             */
            changed: number;
            /**
             * Map Version
             * @description Revision of the collection under which the poses were written.
             */
            map_version: number;
        };
        /**
         * PosesInput
         * @description Poses of many submaps, which are all written or none.
         */
        PosesInput: {
            /**
             * Poses
             * @description The submaps and their poses; each submap once.
             */
            poses: components["schemas"]["PoseMove"][];
        };
        /**
         * PriorPose
         * @description The rough pose of a query in a map: p_map = R(yaw) p_query + t. The point `about` lies at (x, y), roughly.
         */
        PriorPose: {
            /**
             * About
             * @description The point of the query's frame whose position is known, as [x, y] in metres, such as the plot's centre. By default the origin.
             */
            about?: number[] | null;
            /**
             * Covariance
             * @description Covariance of the position of `about`, along the map's axes, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. It must be symmetric and positive definite; without `yaw`, the entries of yaw are not used and may be 0.
             */
            covariance: number[];
            /**
             * Frame Id
             * @description Name of the map's frame, as in `map_pose`.
             */
            frame_id?: string | null;
            /**
             * Noise
             * @description Roughly the standard deviation of one coordinate of a tree in the map against the same stem in the query, in metres. Null if it is unknown; then 0.3 to 1.1 m is tried.
             */
            noise?: number | null;
            /**
             * X
             * @description Most likely position along the map's x axis, in metres, as in `map_pose`.
             */
            x: number;
            /**
             * Y
             * @description Most likely position along the map's y axis, in metres, as in `map_pose`.
             */
            y: number;
            /**
             * Yaw
             * @description Most likely rotation from the query's axes to the map's, in radians, counter-clockwise, from -2 pi to 2 pi. Null if it is unknown; then every rotation is tried.
             */
            yaw?: number | null;
        };
        /**
         * Problem
         * @description An error: a problem document of RFC 9457 (`application/problem+json`).
         */
        Problem: {
            /**
             * Detail
             * @description What happened to this request and what to do.
             */
            detail: string;
            /**
             * Errors
             * @description The faults of the request, one entry each.
             * @default null
             */
            errors: components["schemas"]["FieldProblem"][] | null;
            /**
             * Request Id
             * @description Id of the request. The header X-Request-Id and the log have the same.
             * @default null
             */
            request_id: string | null;
            /**
             * Status
             * @description HTTP status of the answer.
             */
            status: number;
            /**
             * Title
             * @description The type of problem in a few words.
             */
            title: string;
            /**
             * Type
             * @description The type of problem, as a path. GET it for an explanation.
             */
            type: string;
        } & {
            [key: string]: unknown;
        };
        /**
         * PromiseAnswer
         * @description How good a query must be for the search to find its place, if that is stored: in the paper's forest 99 times in
         *     100; rows of trees, and stands with neighbours nearer than 3 m, need the effort `full`.
         */
        PromiseAnswer: {
            /**
             * Detection
             * @description Share of the trees that the query sees.
             */
            detection: number;
            /**
             * Landmarks
             * @description Fewest trees of the query.
             */
            landmarks: number;
            /**
             * Sigma
             * @description Noise of each coordinate, in metres.
             */
            sigma: number;
        };
        /**
         * QueryAnswer
         * @description Where the trees were seen. Decide by `verdict`, not by the pose of a candidate.
         */
        QueryAnswer: {
            /**
             * Candidates
             * @description Submaps that may be the query's place, best first.
             */
            candidates: components["schemas"]["CandidateAnswer"][];
            /**
             * Collection
             * @description Id of the collection.
             */
            collection: string;
            /**
             * Effort
             * @description The effort that was asked for.
             * @default full
             * @enum {string}
             */
            effort: "fast" | "full";
            /**
             * Findings
             * @description What each level of the search found, level by level, best first. Null without `explain`.
             */
            findings: components["schemas"]["FindingAnswer"][] | null;
            /**
             * Findings Total
             * @description Number of findings, of which `findings` lists the 64 with the best log-odds. Null without `explain`.
             */
            findings_total: number | null;
            /**
             * Frame Id
             * @description Name of the query's frame, as it was sent.
             */
            frame_id: string | null;
            /** @description What a pose had to pass to be `matched`. */
            gates: components["schemas"]["GatesAnswer"];
            /**
             * Hints
             * @description What is probably wrong with the query's coordinates, if nothing was found and `explain` was set. Empty if nothing that was tried makes the query match.
             */
            hints?: components["schemas"]["HintAnswer"][];
            /**
             * Id
             * @description Id of the stored query. Null if it is not stored.
             */
            id: string | null;
            /**
             * Landmark Count
             * @description Number of landmarks in the query.
             */
            landmark_count: number;
            /**
             * Lead
             * @description Evidence of the best pose minus that of its strongest rival. Null if no other pose was strong enough to compare.
             */
            lead: number | null;
            /** @description Paths that belong to the answer. */
            links: components["schemas"]["QueryLinks"];
            /**
             * Method
             * @description The method that was asked for.
             * @enum {string}
             */
            method: "robust" | "paper";
            /**
             * Reason
             * @description Why this verdict, as a stable word. `verified`: chance and every rival pose are ruled out; `below_gate`: too little to rule out chance or trees in rows; `rival_too_close`: another pose cannot be ruled out; `outside_prior`: the place seems to lie outside of the prior; `contradicting_maps`: submaps that fit have contradicting map poses; `verification_failed`: more trees speak against the pose than for it; `no_proposal`: no submap has anything like these trees; `empty_collection`: there is no submap to look in; `all_filtered_out`: all submaps are excluded, or none is near; `too_few_landmarks`: fewer than three trees fix no pose; `collinear_landmarks`: trees on one line fix no pose; `deadline`: the time ran out before the search was complete; `angle_unit`: the azimuths fit in gon, not in degrees.
             */
            reason: string;
            /**
             * Revision
             * @description Revision of the collection that was searched.
             */
            revision: number;
            /**
             * Rivals
             * @description Other poses that explain so many of the trees that they are not ruled out, strongest first.
             */
            rivals: components["schemas"]["RivalAnswer"][];
            /** @description Why the search ended and what its limits left out. Null in answers that an older version stored. */
            search?: components["schemas"]["SearchAnswer"] | null;
            /**
             * Sentences
             * @description The meaning of each reason, `refused` and warning in this answer, by its word. Null without `explain`.
             */
            sentences?: {
                [key: string]: string;
            } | null;
            /**
             * Stages
             * @description What each stage of the search did, in order.
             */
            stages: components["schemas"]["StageAnswer"][];
            /**
             * Stamp
             * @description When the query's trees were observed, as it was sent.
             */
            stamp: string | null;
            /**
             * Verdict
             * @description The outcome. Decide by it: `matched`, `ambiguous` or `no_match`.
             * @enum {string}
             */
            verdict: "matched" | "ambiguous" | "no_match";
            /**
             * Warnings
             * @description What is wrong with the query as a whole, as stable words. Always empty without `explain`. `mirrored`: nothing was found, but a mirror image of the query is: an axis or the direction of angles is reversed.
             */
            warnings?: string[];
        };
        /**
         * QueryInput
         * @description Trees that were observed, or the id of a stored submap, to be found among the stored submaps.
         */
        QueryInput: {
            /**
             * Effort
             * @description How far to search if nothing is found. `fast`: a place that is not stored takes 1.5 to 3 times as long as one that is; finds places seen with up to 40 cm of noise and at least 80 % of the trees, and tries an only submap at every shift; `full`: a place that is not stored takes 10 to 20 times as long as one that is, in small collections 1.4 to 1.6 times; finds places seen with more noise and fewer trees, where neighbours are nearer than 3 m, and in rows of trees, too.
             */
            effort?: ("fast" | "full") | null;
            /** @description Submaps to leave out of the search. */
            exclude?: components["schemas"]["Exclude"] | null;
            /**
             * Explain
             * @description Whether to add what each level of the search found in each submap (`findings`), and what the reasons mean (`sentences`).
             */
            explain?: boolean | null;
            /**
             * Frame Id
             * @description Name of the frame that the landmarks' coordinates are in.
             */
            frame_id?: string | null;
            /**
             * Ids
             * @description Ids of the trees in `xy`, one for each. By default their positions in the list as text, counted from 0.
             */
            ids?: string[] | null;
            /**
             * Keyframes
             * @description Several views of the place in a row, with their poses by odometry, instead of `xy` or `landmarks`. They are joined to one observation, so their evidence adds up to one verdict. A tree that several views saw counts once, at the mean of its positions. Poses may be off by 1 m from one view to the next. The id of a tree is the number of the view that saw it first, from 0, `/`, and its id there.
             */
            keyframes?: components["schemas"]["KeyframeBody"][] | null;
            /**
             * Landmarks
             * @description The trees, each with its position, attributes and id. The alternative to `xy`.
             */
            landmarks?: components["schemas"]["Landmark"][] | null;
            /**
             * Limit
             * @description Most candidates to return.
             */
            limit?: number | null;
            /**
             * Method
             * @description `robust`: the method of this service; `paper`: the published one.
             */
            method?: ("robust" | "paper") | null;
            /**
             * Min Confidence
             * @description Least `confidence` that is `matched`. By default that of the collection: 0.998993 if unchanged.
             */
            min_confidence?: number | null;
            /** @description Roughly where the trees were observed, if you know. Only submaps near there are searched. */
            near?: components["schemas"]["Near"] | null;
            /**
             * Pair Format
             * @description How the pairs are listed: as `objects` with ids in `inliers`, or as `columns` of positions in `inlier_columns`, which take a quarter of the bytes. Stored answers list objects, so `columns` does not go with `store`.
             */
            pair_format?: ("objects" | "columns") | null;
            /**
             * Pairs
             * @description Whether to list the landmark pairs of each candidate in `inliers`. Without them the answer is much smaller; verdict, poses and `inlier_count` are the same.
             */
            pairs?: boolean | null;
            /**
             * Per Session
             * @description Whether to return the best candidate of every session, to learn who was here and when. Each is matched by itself.
             */
            per_session?: boolean | null;
            /** @description The rough pose of the query, if you know it, such as that of a GNSS receiver. Then every pose whose position (in the ellipse of the covariance) and whose heading are each within 3.5 standard deviations is tried, in all submaps there together, and none outside; jointly that may be up to 4.9. Less evidence is enough than in the whole collection, and trees may be off by up to 1 m, as tree tops are. Needs the method `robust`; `effort` and `limit` do not matter. */
            prior?: components["schemas"]["PriorPose"] | null;
            /**
             * Seed
             * @description Seed of random choices. The same seed, body and revision give the same answer.
             */
            seed?: number | null;
            /**
             * Stamp
             * @description When the trees were observed, in RFC 3339 form with an offset. Stored to the microsecond; further digits are cut off.
             */
            stamp?: string | null;
            /**
             * Store
             * @description Whether to store the answer, so that it can be read, drawn and explained later.
             */
            store?: boolean | null;
            /**
             * Submap Id
             * @description Id of a stored submap whose landmarks to search for, instead of `xy` or `landmarks`. The submap itself is left out of the search.
             */
            submap_id?: string | null;
            /**
             * Timeout Ms
             * @description Milliseconds within which you need the answer, counted from when the whole request has arrived. The limit `query_seconds` is the maximum and the default. At the deadline the answer is `no_match` with the reason `deadline` and the candidates found so far.
             */
            timeout_ms?: number | null;
            /**
             * Xy
             * @description Positions of the trees as [x, y], in metres. The alternative to `landmarks`.
             */
            xy?: number[][] | null;
        };
        /**
         * QueryLinks
         * @description Paths that belong to an answer.
         */
        QueryLinks: {
            /**
             * Collection
             * @description Path of the collection.
             */
            collection: string;
            /**
             * Explanation
             * @description Path of the explanation of the answer. Null if the query is not stored.
             */
            explanation: string | null;
            /**
             * Self
             * @description Path of the stored answer. Null if the query is not stored.
             */
            self: string | null;
        };
        /**
         * QueryOptions
         * @description Where to search, how, and what to return.
         */
        QueryOptions: {
            /**
             * Effort
             * @description How far to search if nothing is found. `fast`: a place that is not stored takes 1.5 to 3 times as long as one that is; finds places seen with up to 40 cm of noise and at least 80 % of the trees, and tries an only submap at every shift; `full`: a place that is not stored takes 10 to 20 times as long as one that is, in small collections 1.4 to 1.6 times; finds places seen with more noise and fewer trees, where neighbours are nearer than 3 m, and in rows of trees, too.
             */
            effort?: ("fast" | "full") | null;
            /** @description Submaps to leave out of the search. */
            exclude?: components["schemas"]["Exclude"] | null;
            /**
             * Explain
             * @description Whether to add what each level of the search found in each submap (`findings`), and what the reasons mean (`sentences`).
             */
            explain?: boolean | null;
            /**
             * Limit
             * @description Most candidates to return.
             */
            limit?: number | null;
            /**
             * Method
             * @description `robust`: the method of this service; `paper`: the published one.
             */
            method?: ("robust" | "paper") | null;
            /**
             * Min Confidence
             * @description Least `confidence` that is `matched`. By default that of the collection: 0.998993 if unchanged.
             */
            min_confidence?: number | null;
            /** @description Roughly where the trees were observed, if you know. Only submaps near there are searched. */
            near?: components["schemas"]["Near"] | null;
            /**
             * Pair Format
             * @description How the pairs are listed: as `objects` with ids in `inliers`, or as `columns` of positions in `inlier_columns`, which take a quarter of the bytes. Stored answers list objects, so `columns` does not go with `store`.
             */
            pair_format?: ("objects" | "columns") | null;
            /**
             * Pairs
             * @description Whether to list the landmark pairs of each candidate in `inliers`. Without them the answer is much smaller; verdict, poses and `inlier_count` are the same.
             */
            pairs?: boolean | null;
            /**
             * Per Session
             * @description Whether to return the best candidate of every session, to learn who was here and when. Each is matched by itself.
             */
            per_session?: boolean | null;
            /** @description The rough pose of the query, if you know it, such as that of a GNSS receiver. Then every pose whose position (in the ellipse of the covariance) and whose heading are each within 3.5 standard deviations is tried, in all submaps there together, and none outside; jointly that may be up to 4.9. Less evidence is enough than in the whole collection, and trees may be off by up to 1 m, as tree tops are. Needs the method `robust`; `effort` and `limit` do not matter. */
            prior?: components["schemas"]["PriorPose"] | null;
            /**
             * Seed
             * @description Seed of random choices. The same seed, body and revision give the same answer.
             */
            seed?: number | null;
            /**
             * Timeout Ms
             * @description Milliseconds within which you need the answer, counted from when the whole request has arrived. The limit `query_seconds` is the maximum and the default. At the deadline the answer is `no_match` with the reason `deadline` and the candidates found so far.
             */
            timeout_ms?: number | null;
        };
        /**
         * QueryPage
         * @description A page of stored queries, newest first.
         */
        QueryPage: {
            /**
             * Next
             * @description Cursor of the next page. The last page does not have this member.
             */
            next?: string | null;
            /**
             * Queries
             * @description The queries of the page.
             */
            queries: components["schemas"]["StoredQuery"][];
        };
        /**
         * Readiness
         * @description Answer of a process that has passed all checks.
         */
        Readiness: {
            /**
             * Checks
             * @description Result of each check, by its name.
             */
            checks: {
                [key: string]: string;
            };
            /** @description How busy the process is. */
            load: components["schemas"]["Load"];
            /**
             * Status
             * @description Always `ok`.
             */
            status: string;
        };
        /**
         * Retention
         * @description How long the service keeps what it stores on behalf of requests.
         */
        Retention: {
            /**
             * Idempotency Hours
             * @description Hours within which a repetition of a request with the same `Idempotency-Key` gets the first answer.
             */
            idempotency_hours: number;
            /**
             * Stored Queries
             * @description Number of stored queries that are kept in each collection. The oldest are deleted first.
             */
            stored_queries: number;
        };
        /**
         * RivalAnswer
         * @description Another pose that explains so many of the trees that it is not ruled out.
         */
        RivalAnswer: {
            /**
             * Evidence
             * @description Evidence of the pose, extrapolated to the overlap of the first candidate, and less what chance explains.
             */
            evidence: number;
            /**
             * Inlier Count
             * @description Number of pairs of landmarks that agree under the transform.
             */
            inlier_count: number;
            /** @description Paths that belong to the rival. */
            links: components["schemas"]["RivalLinks"];
            /**
             * Submap Id
             * @description Id of the submap. Often the first candidate's: in rows of trees, its pose moved to the next row.
             */
            submap_id: string;
            /** @description submap_T_query: p_submap = R(yaw) p_query + (x, y). */
            transform: components["schemas"]["Transform"];
        };
        /**
         * RivalLinks
         * @description Paths that belong to a rival.
         */
        RivalLinks: {
            /**
             * Submap
             * @description Path of the submap.
             */
            submap: string;
        };
        /**
         * SearchAnswer
         * @description How the search ended and what its limits left out, so whether a longer search could have found more.
         */
        SearchAnswer: {
            /** @description How good the query must be for this to mean that its place is not stored. Null unless `stopped_by` is `evidence_bound`. */
            promised?: components["schemas"]["PromiseAnswer"] | null;
            /**
             * Sentence
             * @description `stopped_by` and `skipped` as a sentence.
             */
            sentence: string;
            /**
             * Skipped
             * @description Limits that left something out, as stable words. Empty if none did. `quad_hits`: the limit on quad hits was reached before all quads of the query were looked for; `common_quads`: quads of the query that are too common in the collection were passed over; `exhaustive`: the collection is too large to try every rotation and shift in it; `exhaustive_rest`: only the most similar submaps and headings were searched shift by shift, and the others not.
             */
            skipped: ("quad_hits" | "common_quads" | "exhaustive" | "exhaustive_rest")[];
            /**
             * Stopped By
             * @description Why the search ended, as a stable word. `decided`: the first candidate is so sure that searching on could not change the answer; `beats_chance`: chance is ruled out for the first candidate; searching on would only add weaker poses; `evidence_bound`: a stored place would have shown more evidence by now, if the query is as good as promised; `effort`: the effort fast ends here, which says nothing about so few trees; search with the effort full; `exhausted`: everything that this method can try was tried; `window`: every pose of the prior's window was tried, and none outside of it; `deadline`: the time ran out before all was searched; with a prior, give a heading or a smaller sigma; `not_started`: there was nothing to search for, or nothing to search in.
             * @enum {string}
             */
            stopped_by: "decided" | "beats_chance" | "evidence_bound" | "effort" | "exhausted" | "window" | "deadline" | "not_started";
        };
        /**
         * SessionConstraint
         * @description A constraint of the session, and whether the poses use it.
         */
        SessionConstraint: {
            /**
             * From
             * @description Id of the submap whose frame the constraint is in.
             */
            from: string;
            /**
             * Id
             * @description Id of the constraint.
             */
            id: string;
            /**
             * Kind
             * @description A match that a search found, or posted odometry.
             * @enum {string}
             */
            kind: "match" | "odometry";
            /**
             * Standing
             * @description `used` by the poses; `pending` until the next search of all constraints; or left out as in a map: `contradicted` by others, `unconfirmed` by any, `undecided` odometry that contradicts other odometry.
             * @enum {string}
             */
            standing: "used" | "pending" | "contradicted" | "unconfirmed" | "undecided";
            /**
             * To
             * @description Id of the other submap.
             */
            to: string;
        };
        /**
         * SessionPage
         * @description A page of sessions.
         */
        SessionPage: {
            /**
             * Next
             * @description Cursor of the next page. The last page does not have this member.
             */
            next?: string | null;
            /**
             * Sessions
             * @description The sessions of the page.
             */
            sessions: components["schemas"]["SessionSummary"][];
        };
        /**
         * SessionPart
         * @description Submaps of a session that constraints connect.
         */
        SessionPart: {
            /**
             * Frame Of
             * @description Id of the submap whose frame its poses are in: the one that it began with.
             */
            frame_of: string;
            /**
             * Part
             * @description Number of the part, from 1; 1 is the largest one.
             */
            part: number;
            /**
             * Submaps
             * @description Number of its submaps.
             */
            submaps: number;
        };
        /**
         * SessionPose
         * @description A pose in the frame of its part.
         */
        SessionPose: {
            /**
             * Covariance
             * @description Covariance of the position of the submap's origin, along the axes of the frame, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. All 0 for the submap whose frame it is.
             */
            covariance: number[];
            /**
             * X
             * @description Position of the submap's origin along the frame's x axis, in metres.
             */
            x: number;
            /**
             * Y
             * @description The same along the frame's y axis, in metres.
             */
            y: number;
            /**
             * Yaw
             * @description Radians, counter-clockwise, from -pi to pi.
             */
            yaw: number;
        };
        /**
         * SessionPosesAnswer
         * @description The poses of a session now.
         */
        SessionPosesAnswer: {
            /**
             * Constraints
             * @description The constraints between submaps of the session, in the order they were stored. Stale ones, and matches of searches with other gates, are left out.
             */
            constraints: components["schemas"]["SessionConstraint"][];
            /**
             * Parts
             * @description Parts that no constraint connects, the largest first.
             */
            parts: components["schemas"]["SessionPart"][];
            /**
             * Poses
             * @description The submaps, in the order they were stored.
             */
            poses: components["schemas"]["SessionSubmap"][];
            /**
             * Revision
             * @description Revision of the collection that the answer is of.
             */
            revision: number;
            /**
             * Session
             * @description The session.
             */
            session: string;
            /**
             * Settled
             * @description Whether all constraints are judged. If false, a search of all of them runs or will run in the background; until it ends, the poses use what could be judged without it.
             */
            settled: boolean;
        };
        /**
         * SessionSubmap
         * @description A submap of the session and its pose now.
         */
        SessionSubmap: {
            /**
             * Content Revision
             * @description Revision of the collection when its landmarks were stored.
             */
            content_revision: number;
            /**
             * Id
             * @description Id of the submap.
             */
            id: string;
            /**
             * Part
             * @description Number of the part that it belongs to.
             */
            part: number;
            /** @description `part_T_submap`: its pose in the frame of the part. */
            pose: components["schemas"]["SessionPose"];
        };
        /**
         * SessionSummary
         * @description A session: submaps that were gathered in one drive, flight or survey.
         */
        SessionSummary: {
            /**
             * First
             * @description Earliest stamp of the session's submaps. Null if none has one.
             */
            first: string | null;
            /**
             * Landmarks
             * @description Number of landmarks in all the session's submaps.
             */
            landmarks: number;
            /**
             * Last
             * @description Latest stamp of the session's submaps. Null if none has one.
             */
            last: string | null;
            /**
             * Session
             * @description Name of the session.
             */
            session: string;
            /**
             * Submaps
             * @description Number of the session's submaps.
             */
            submaps: number;
        };
        /**
         * Snapshot
         * @description A copy of the whole database as it was at one moment.
         */
        Snapshot: {
            /**
             * Bytes
             * @description Size of the file, in bytes.
             */
            bytes: number;
            /**
             * Collections
             * @description The collections in the snapshot, oldest first.
             */
            collections: components["schemas"]["SnapshotCollection"][];
            /**
             * Created
             * @description When the snapshot was created.
             */
            created: string;
            /**
             * Name
             * @description Name of the snapshot.
             */
            name: string;
            /**
             * Schema
             * @description Version of the database schema.
             */
            schema: string;
            /**
             * Sha256
             * @description SHA-256 of the file, in hexadecimal. It is also the entity tag of the download.
             */
            sha256: string;
            /**
             * Version
             * @description Version of the service that created the snapshot.
             */
            version: string;
        };
        /**
         * SnapshotCollection
         * @description A collection as it is in a snapshot.
         */
        SnapshotCollection: {
            /**
             * Id
             * @description Id of the collection.
             */
            id: string;
            /**
             * Revision
             * @description Revision of the collection in the snapshot.
             */
            revision: number;
            /**
             * Submaps
             * @description Number of the collection's submaps in the snapshot.
             */
            submaps: number;
        };
        /**
         * SnapshotInput
         * @description A snapshot to create.
         */
        SnapshotInput: {
            /**
             * Name
             * @description Name of the snapshot. By default the time of its creation.
             */
            name?: string | null;
        };
        /**
         * SnapshotPage
         * @description A page of snapshots.
         */
        SnapshotPage: {
            /**
             * Next
             * @description Cursor of the next page. The last page does not have this member.
             */
            next?: string | null;
            /**
             * Snapshots
             * @description The snapshots of the page, oldest first.
             */
            snapshots: components["schemas"]["Snapshot"][];
        };
        /**
         * SpatialExtent
         * @description The area that the submaps cover in one map frame.
         */
        SpatialExtent: {
            /**
             * Bbox
             * @description Bounding box of the footprints as [min x, min y, max x, max y], in metres in the map frame.
             */
            bbox: number[];
            /**
             * Frame Id
             * @description Name of the map frame.
             */
            frame_id: string;
        };
        /**
         * StageAnswer
         * @description A stage of the search.
         */
        StageAnswer: {
            /**
             * Counts
             * @description How many things the stage made or looked at, by their name.
             */
            counts: {
                [key: string]: number;
            };
            /**
             * Milliseconds
             * @description How long the stage took, in milliseconds.
             */
            milliseconds: number;
            /**
             * Name
             * @description Name of the stage.
             */
            name: string;
        };
        /**
         * Stand
         * @description What was stored from one stem map, and is replaced and deleted as a whole.
         */
        Stand: {
            /**
             * Created
             * @description When a stand of this name was first stored.
             */
            created: string;
            /**
             * Crs
             * @description Coordinate reference system of that map frame. Null if it has none.
             */
            crs: string | null;
            /**
             * Etag
             * @description Entity tag of the stand.
             */
            etag: string;
            /**
             * Frame Id
             * @description Map frame of the stand's submaps.
             */
            frame_id: string;
            /** @description Paths of the stand and its collection. */
            links: components["schemas"]["StandLinks"];
            /**
             * Name
             * @description Name of the stand: that of the file, without its suffix.
             */
            name: string;
            /**
             * Origin
             * @description Easting and northing, in metres, of the map frame's origin in the CRS. Null if it has none.
             */
            origin: number[] | null;
            /**
             * Radius
             * @description Radius of a submap, in metres.
             */
            radius: number;
            /**
             * Source Crs
             * @description Coordinate reference system of the trees' positions, as the file or `--crs` names it. Null if unknown. To show the stand on a map, give it to the map frame: PATCH the collection's `frames`.
             */
            source_crs: string | null;
            /**
             * Source Hash
             * @description BLAKE2b digest of the file, 12 bytes in hexadecimal. Null if unknown.
             */
            source_hash: string | null;
            /**
             * Spacing
             * @description Distance between the centres of neighbouring submaps, in metres.
             */
            spacing: number;
            /**
             * Submaps
             * @description Number of the stand's submaps. A PUT of a submap takes it out of its stand, a DELETE removes it.
             */
            submaps: number;
            /**
             * Trees
             * @description Number of trees in the file.
             */
            trees: number;
            /**
             * Trees Hash
             * @description Digest of the trees' positions, whatever their order. Stands with equal digests have equal trees.
             */
            trees_hash: string;
            /**
             * Updated
             * @description When the stand was last stored.
             */
            updated: string;
        };
        /**
         * StandCounts
         * @description The stands of a collection together.
         */
        StandCounts: {
            /**
             * Stands
             * @description Number of stands.
             */
            stands: number;
            /**
             * Trees
             * @description Number of trees in the files of the stands, each once. Submaps of a stand overlap, so `landmarks` counts many of them several times.
             */
            trees: number;
        };
        /**
         * StandLinks
         * @description Paths of a stand and its collection.
         */
        StandLinks: {
            /**
             * Collection
             * @description Path of the stand's collection.
             */
            collection: string;
            /**
             * Self
             * @description Path of the stand.
             */
            self: string;
        };
        /**
         * StandMove
         * @description How all submaps of a stand move together in their map frame: turned about a point, then shifted.
         */
        StandMove: {
            /**
             * About
             * @description Point of the map frame that the stand turns about, in metres. Default: the middle of the box around its submaps.
             */
            about?: number[] | null;
            /**
             * Shift
             * @description How far to shift along x (east) and y (north) of the map frame, in metres.
             */
            shift?: number[] | null;
            /**
             * Yaw
             * @description How far to turn, in radians, counter-clockwise.
             */
            yaw?: number | null;
        };
        /**
         * StandPage
         * @description A page of stands.
         */
        StandPage: {
            /**
             * Next
             * @description Cursor of the next page. The last page does not have this member.
             */
            next?: string | null;
            /**
             * Stands
             * @description The stands of the page, in the order they were first stored.
             */
            stands: components["schemas"]["Stand"][];
        };
        /**
         * StandReceipt
         * @description A stand that was stored from a file, and how the file was understood.
         */
        StandReceipt: {
            /**
             * Assumed
             * @description Units that nobody named, by the parameters that name them. Feet were taken for international feet (`unit`), azimuths for degrees (`angle`), diameters for centimetres (`dbh_unit`), heights for metres (`height_unit`). Repeat the request with the parameter to be sure: azimuths in gon that are read as degrees misplace trees.
             */
            assumed?: ("unit" | "angle" | "dbh_unit" | "height_unit")[];
            /**
             * Created
             * @description When a stand of this name was first stored.
             */
            created: string;
            /**
             * Crs
             * @description Coordinate reference system of that map frame. Null if it has none.
             */
            crs: string | null;
            /**
             * Etag
             * @description Entity tag of the stand.
             */
            etag: string;
            /**
             * Frame Id
             * @description Map frame of the stand's submaps.
             */
            frame_id: string;
            /** @description Paths of the stand and its collection. */
            links: components["schemas"]["StandLinks"];
            /**
             * Name
             * @description Name of the stand: that of the file, without its suffix.
             */
            name: string;
            /**
             * Origin
             * @description Easting and northing, in metres, of the map frame's origin in the CRS. Null if it has none.
             */
            origin: number[] | null;
            /**
             * Radius
             * @description Radius of a submap, in metres.
             */
            radius: number;
            /** @description How many rows of the file were read, and how many were left out and why. */
            rows: components["schemas"]["FileRows"];
            /**
             * Source Crs
             * @description Coordinate reference system of the trees' positions, as the file or `--crs` names it. Null if unknown. To show the stand on a map, give it to the map frame: PATCH the collection's `frames`.
             */
            source_crs: string | null;
            /**
             * Source Hash
             * @description BLAKE2b digest of the file, 12 bytes in hexadecimal. Null if unknown.
             */
            source_hash: string | null;
            /**
             * Spacing
             * @description Distance between the centres of neighbouring submaps, in metres.
             */
            spacing: number;
            /**
             * Submaps
             * @description Number of the stand's submaps. A PUT of a submap takes it out of its stand, a DELETE removes it.
             */
            submaps: number;
            /**
             * Trees
             * @description Number of trees in the file.
             */
            trees: number;
            /**
             * Trees Hash
             * @description Digest of the trees' positions, whatever their order. Stands with equal digests have equal trees.
             */
            trees_hash: string;
            /**
             * Understood
             * @description What was read as what, such as units, what is not used, and what is in no submap and why.
             */
            understood: string;
            /**
             * Updated
             * @description When the stand was last stored.
             */
            updated: string;
        };
        /**
         * StemMapAnswer
         * @description What a file of trees holds, and how it was understood.
         */
        StemMapAnswer: {
            /**
             * Assumed
             * @description Units that nobody named, by the parameters that name them. Feet were taken for international feet (`unit`), azimuths for degrees (`angle`), diameters for centimetres (`dbh_unit`), heights for metres (`height_unit`). Repeat the request with the parameter to be sure: azimuths in gon that are read as degrees misplace trees.
             */
            assumed?: ("unit" | "angle" | "dbh_unit" | "height_unit")[];
            /**
             * Crs
             * @description Coordinate reference system of the positions. Null if it is not known.
             */
            crs: string | null;
            /**
             * Name
             * @description Name of the file, without its suffix.
             */
            name: string;
            /**
             * Own Frames
             * @description Whether each plot has coordinates of its own, because they overlap.
             */
            own_frames: boolean;
            /**
             * Plots
             * @description The trees, by plots.
             */
            plots: components["schemas"]["StemMapPlot"][];
            /** @description How many rows were read, and how many were left out and why. */
            rows: components["schemas"]["FileRows"];
            /**
             * Understood
             * @description What was read as what, what is not used, and what was passed over.
             */
            understood: string;
        };
        /**
         * StemMapPlot
         * @description The trees of one plot, or of a file without plots.
         */
        StemMapPlot: {
            /**
             * Landmarks
             * @description The trees, stems within 1 cm merged. Positions in metres.
             */
            landmarks: components["schemas"]["Landmark"][];
            /**
             * Name
             * @description Name of the plot. Null if the file has no column of plots.
             */
            name: string | null;
        };
        /**
         * StoredLandmark
         * @description A stored landmark. Attributes that it does not have are left out.
         */
        StoredLandmark: {
            /**
             * Dbh Cm
             * @description Diameter at breast height, in centimetres.
             */
            dbh_cm?: number | null;
            /**
             * Height M
             * @description Height of the tree, in metres.
             */
            height_m?: number | null;
            /**
             * Id
             * @description Id of the tree, unique in the submap.
             */
            id: string;
            /**
             * Species
             * @description Species of the tree, as it was sent.
             */
            species?: string | null;
            /**
             * X
             * @description Position along x, in metres, in the submap's frame.
             */
            x: number;
            /**
             * Y
             * @description Position along y, in metres, in the submap's frame.
             */
            y: number;
        };
        /**
         * StoredQuery
         * @description A stored query, as in a list.
         */
        StoredQuery: {
            /**
             * Confidence
             * @description Confidence of the first candidate. Null if there is no candidate.
             */
            confidence: number | null;
            /**
             * Created
             * @description When the query was answered.
             */
            created: string;
            /**
             * Id
             * @description Id of the stored query.
             */
            id: string;
            /**
             * Inlier Count
             * @description Pairs of landmarks of the first candidate. Null if there is none.
             */
            inlier_count: number | null;
            /**
             * Landmark Count
             * @description Number of landmarks in the query.
             */
            landmark_count: number;
            /** @description Paths that belong to the query. */
            links: components["schemas"]["QueryLinks"];
            /**
             * Milliseconds
             * @description How long the search took, in milliseconds.
             */
            milliseconds: number;
            /**
             * Reason
             * @description Why this verdict, as a stable word: one of those of an answer.
             */
            reason: string;
            /**
             * Revision
             * @description Revision of the collection that was searched.
             */
            revision: number;
            /**
             * Submap Id
             * @description Submap of the first candidate. Null if there is no candidate.
             */
            submap_id: string | null;
            /**
             * Verdict
             * @description The outcome.
             * @enum {string}
             */
            verdict: "matched" | "ambiguous" | "no_match";
        };
        /**
         * Submap
         * @description A submap with its landmarks.
         */
        Submap: {
            /**
             * Collection
             * @description Id of the collection.
             */
            collection: string;
            /**
             * Counts
             * @description Numbers of landmarks, triangles and polygons of the submap, by name.
             */
            counts: {
                [key: string]: number;
            };
            /**
             * Created
             * @description When the submap was first stored.
             */
            created: string;
            /**
             * Etag
             * @description Entity tag of the submap, for `If-Match` and `If-None-Match`.
             */
            etag: string;
            /**
             * Frame Id
             * @description Name of the frame that the landmarks' coordinates are in.
             */
            frame_id: string | null;
            /**
             * Id
             * @description Id of the submap.
             */
            id: string;
            /**
             * Landmarks
             * @description The landmarks, in the order they were sent.
             */
            landmarks: components["schemas"]["StoredLandmark"][];
            /** @description Paths of the submap, its collection and its tessellation. */
            links: components["schemas"]["SubmapLinks"];
            /** @description Pose of the submap's frame in a map, if it is known. */
            map_pose: components["schemas"]["PlacedPose"] | null;
            /**
             * Properties
             * @description Other data that were stored with the submap.
             */
            properties: {
                [key: string]: unknown;
            } | null;
            /**
             * Revision
             * @description Revision of the collection at the last write of the submap.
             */
            revision: number;
            /**
             * Session
             * @description The drive, flight or survey that the submap belongs to.
             */
            session: string | null;
            /**
             * Stamp
             * @description When the trees were observed, in RFC 3339 form, in UTC.
             */
            stamp: string | null;
            /**
             * Updated
             * @description When the submap was last changed.
             */
            updated: string;
        };
        /**
         * SubmapLinks
         * @description Paths of a submap, its collection and its tessellation.
         */
        SubmapLinks: {
            /**
             * Collection
             * @description Path of the collection.
             */
            collection: string;
            /**
             * Self
             * @description Path of the submap.
             */
            self: string;
            /**
             * Tessellation
             * @description Path of the submap's tessellation.
             */
            tessellation: string;
        };
        /**
         * SubmapPage
         * @description A page of submaps.
         */
        SubmapPage: {
            /**
             * Next
             * @description Cursor of the next page. The last page does not have this member.
             */
            next?: string | null;
            /**
             * Submaps
             * @description The submaps of the page, oldest first.
             */
            submaps: components["schemas"]["SubmapSummary"][];
        };
        /**
         * SubmapPatch
         * @description Members of a submap to change. Null removes a member; a member left out stays.
         */
        SubmapPatch: {
            /**
             * Frame Id
             * @description Name of the frame that the landmarks' coordinates are in.
             */
            frame_id?: string | null;
            /**
             * Ids
             * @description Ids of the trees in `xy`, one for each. By default their positions in the list as text, counted from 0.
             */
            ids?: string[] | null;
            /**
             * Landmarks
             * @description The trees, each with its position, attributes and id. The alternative to `xy`.
             */
            landmarks?: components["schemas"]["Landmark"][] | null;
            /** @description Pose of the submap's frame in a map, if it is known. */
            map_pose?: components["schemas"]["MapPose"] | null;
            /**
             * Properties
             * @description Any other data that you want to store with the submap, as a JSON object.
             */
            properties?: {
                [key: string]: unknown;
            } | null;
            /**
             * Session
             * @description The drive, flight or survey that the submap belongs to.
             */
            session?: string | null;
            /**
             * Stamp
             * @description When the trees were observed, in RFC 3339 form with an offset. Stored to the microsecond; further digits are cut off.
             */
            stamp?: string | null;
            /**
             * Xy
             * @description Positions of the trees as [x, y], in metres. The alternative to `landmarks`.
             */
            xy?: number[][] | null;
        };
        /**
         * SubmapReceipt
         * @description The outcome of storing a submap.
         */
        SubmapReceipt: {
            /**
             * Cleared
             * @description Optional members that the submap had before and that this PUT removed, such as `session`, `map_pose`, or `dbh_cm` of its landmarks. PUT replaces the whole submap; PATCH keeps members that it does not name.
             */
            cleared?: string[];
            /**
             * Collection
             * @description Id of the collection.
             */
            collection: string;
            /**
             * Counts
             * @description Numbers of landmarks, triangles and polygons of the submap, by name.
             */
            counts: {
                [key: string]: number;
            };
            /**
             * Detail
             * @description Why nothing was stored, as a sentence. Null otherwise.
             */
            detail?: string | null;
            /**
             * Etag
             * @description Entity tag of what is stored under the id now, for `If-Match`. Null if nothing is.
             */
            etag: string | null;
            /**
             * Id
             * @description Id of the submap. Null if a POST stored nothing.
             */
            id: string | null;
            /** @description Paths of the submap, its collection and its tessellation. Null if there is no submap. */
            links: components["schemas"]["SubmapLinks"] | null;
            /**
             * Outcome
             * @description What was done. `not_stored`: the submap came with a `query`, which is answered, but too few trees, or trees on one line, make no submap.
             * @enum {string}
             */
            outcome: "created" | "replaced" | "unchanged" | "not_stored";
            /** @description Where else the submap was seen, among all submaps that were stored before it. Left out unless the submap came with a `query`. */
            query?: components["schemas"]["QueryAnswer"] | null;
            /**
             * Reason
             * @description Why nothing was stored, as a stable word: the `reason` of `query`. Null otherwise.
             */
            reason?: string | null;
            /**
             * Revision
             * @description Revision of the collection at the last write of the submap. If there is no submap, its present one.
             */
            revision: number;
        };
        /**
         * SubmapSummary
         * @description A submap without its landmarks, as in a list.
         */
        SubmapSummary: {
            /**
             * Collection
             * @description Id of the collection.
             */
            collection: string;
            /**
             * Counts
             * @description Numbers of landmarks, triangles and polygons of the submap, by name.
             */
            counts: {
                [key: string]: number;
            };
            /**
             * Created
             * @description When the submap was first stored.
             */
            created: string;
            /**
             * Etag
             * @description Entity tag of the submap, for `If-Match` and `If-None-Match`.
             */
            etag: string;
            /**
             * Frame Id
             * @description Name of the frame that the landmarks' coordinates are in.
             */
            frame_id: string | null;
            /**
             * Id
             * @description Id of the submap.
             */
            id: string;
            /** @description Paths of the submap, its collection and its tessellation. */
            links: components["schemas"]["SubmapLinks"];
            /** @description Pose of the submap's frame in a map, if it is known. */
            map_pose: components["schemas"]["PlacedPose"] | null;
            /**
             * Properties
             * @description Other data that were stored with the submap.
             */
            properties: {
                [key: string]: unknown;
            } | null;
            /**
             * Revision
             * @description Revision of the collection at the last write of the submap.
             */
            revision: number;
            /**
             * Session
             * @description The drive, flight or survey that the submap belongs to.
             */
            session: string | null;
            /**
             * Stamp
             * @description When the trees were observed, in RFC 3339 form, in UTC.
             */
            stamp: string | null;
            /**
             * Updated
             * @description When the submap was last changed.
             */
            updated: string;
        };
        /**
         * SurveyPose
         * @description A pose as surveyors give it: shift and turn about the middle of the query's trees. Lengths are in metres.
         *
         *     The shift is what to add to the query's coordinates, if they are meant to be those of this frame. Otherwise it is
         *     only the difference of two frames, and `position` is what tells the place.
         */
        SurveyPose: {
            /**
             * About
             * @description The point that `covariance` is about: `centre`.
             * @default query_centre
             * @constant
             */
            about: "query_centre";
            /**
             * Axes
             * @description What the first and the second coordinate point to: `east` and `north` if the map frame has a coordinate reference system, else `x` and `y`.
             */
            axes: ("east" | "x")[];
            /**
             * Centre
             * @description The middle (mean) of the query's landmarks, in metres, in the query's frame.
             */
            centre: number[];
            /**
             * Covariance
             * @description Covariance of `shift` along `axes`, and of the turn in radians: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians. Null if it is unknown, because that of `map_pose` is.
             */
            covariance: number[] | null;
            /**
             * Covariance Frame
             * @description Axes of `covariance`: those of the map's frame, or of the submap's if it has no `map_pose`.
             * @enum {string}
             */
            covariance_frame: "map" | "submap";
            /**
             * Crs
             * @description Coordinate reference system of the map frame, as the collection, or the stem map stored there, names it. Null if it is not known.
             */
            crs: string | null;
            /**
             * Crs Position
             * @description `position` in full coordinates of `crs`, east first, in its unit. Null without a projected system.
             */
            crs_position: number[] | null;
            /**
             * Crs Shift
             * @description `crs_position` minus `centre`, both in metres: what to add to the query's coordinates, if they are meant to be those of `crs`. It differs from `shift` by the origin of the map frame. Null without a projected system.
             */
            crs_shift?: number[] | null;
            /**
             * Crs Unit
             * @description Name of the unit of `crs`, and so of `crs_position`. Null without a projected system.
             */
            crs_unit: string | null;
            /**
             * Frame Id
             * @description Name of the map frame that the pose is in. Null if the submap has no `map_pose`: the pose is then in the submap's frame.
             */
            frame_id: string | null;
            /**
             * Metres Per Unit
             * @description Metres in one `crs_unit`. Null without a projected system.
             */
            metres_per_unit: number | null;
            /**
             * Position
             * @description The same point in the map frame (or the submap's), in metres.
             */
            position: number[];
            /**
             * Shift
             * @description `position` minus `centre`, in metres: dE and dN if `axes` are east and north.
             */
            shift: number[];
            /**
             * Shift Sigma
             * @description Standard deviations of `shift`, in metres. Null if `covariance` is null.
             */
            shift_sigma: number[] | null;
            /**
             * Turn Degrees
             * @description Turn of the query about `centre`, in degrees, from -180 to 180; positive as `turn_positive` says.
             */
            turn_degrees: number;
            /**
             * Turn Positive
             * @description Direction of a positive turn, seen from above.
             * @default counter_clockwise
             * @constant
             */
            turn_positive: "counter_clockwise";
            /**
             * Turn Sigma Degrees
             * @description Standard deviation of the turn, in degrees. Null if `covariance` is null.
             */
            turn_sigma_degrees: number | null;
        };
        /**
         * TessellationAnswer
         * @description The triangles and polygons of a submap.
         */
        TessellationAnswer: {
            /**
             * Counts
             * @description Numbers of landmarks, triangles and polygons of the submap, by name.
             */
            counts: {
                [key: string]: number;
            };
            /**
             * Fingerprint
             * @description Hash of the parameters that the features were computed with.
             */
            fingerprint: string;
            /**
             * Landmarks
             * @description The submap's landmarks, in the order they were sent.
             */
            landmarks: components["schemas"]["StoredLandmark"][];
            /**
             * Polygons
             * @description The interior Urquhart polygons.
             */
            polygons: components["schemas"]["TessellationPolygon"][];
            /**
             * Submap Id
             * @description Id of the submap.
             */
            submap_id: string;
            /**
             * Triangles
             * @description The Delaunay triangles: three positions in `landmarks` each, counted from 0, counter-clockwise.
             */
            triangles: number[][];
        };
        /**
         * TessellationPolygon
         * @description An interior Urquhart polygon.
         */
        TessellationPolygon: {
            /**
             * Descriptor
             * @description The numbers that the polygon is compared by.
             */
            descriptor: number[];
            /**
             * Triangles
             * @description The triangles that the polygon is joined from, as positions in `triangles`, counted from 0.
             */
            triangles: number[];
            /**
             * Vertices
             * @description The polygon's vertices, counter-clockwise, as positions in `landmarks`, counted from 0.
             */
            vertices: number[];
        };
        /**
         * Transform
         * @description A rigid transform: a rotation by `yaw`, then a translation by (x, y).
         */
        Transform: {
            /**
             * X
             * @description Translation along x, in metres, in the frame that the transform takes points to.
             */
            x: number;
            /**
             * Y
             * @description Translation along y, in metres, in the frame that the transform takes points to.
             */
            y: number;
            /**
             * Yaw
             * @description Rotation in radians, counter-clockwise.
             */
            yaw: number;
        };
        /**
         * TreesMiddle
         * @description The uncertainty of a transform about the middle of the trees that it was fitted to.
         *
         *     These matrices can be inverted wherever the frames' origins are. Use them if coordinates are far from the origin.
         */
        TreesMiddle: {
            /**
             * Covariance
             * @description Covariance of the position of `target`, along the axes of its frame, and of the yaw: 3x3, row-major over (x, y, yaw), in square metres, metre radians and square radians.
             */
            covariance: number[];
            /**
             * Information
             * @description Information matrix, 3x3, row-major: the inverse of `covariance`.
             */
            information: number[];
            /**
             * Source
             * @description The middle of the trees as [x, y] in metres, in the frame that the transform takes points from.
             */
            source: number[];
            /**
             * Target
             * @description The middle of the trees as [x, y] in metres, in the frame that the transform takes points to.
             */
            target: number[];
        };
        /**
         * Versions
         * @description Versions of the running service.
         */
        Versions: {
            /**
             * Api
             * @description Version of the API, as in its paths.
             */
            api: string;
            /**
             * Schema
             * @description Version of the database schema.
             */
            schema: string;
            /**
             * Service
             * @description Version of the service.
             */
            service: string;
        };
    };
    responses: never;
    parameters: never;
    requestBodies: never;
    headers: never;
    pathItems: never;
}
export type $defs = Record<string, never>;
export interface operations {
    getLandingPage: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": Record<string, never>;
                };
            };
            /** @description Browsers are sent on to the console, /ui. */
            303: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getLiveness: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Liveness"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getMetrics: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Prometheus text format. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "text/plain": string;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getFeaturesLandingPage: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": Record<string, never>;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listFeatureCollections: {
        parameters: {
            query?: {
                /** @description `next` of the previous page. */
                cursor?: string | null;
            };
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": Record<string, never>;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getFeatureCollection: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `landmarks` or `submaps`. */
                kind: "landmarks" | "submaps";
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": Record<string, never>;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listFeatures: {
        parameters: {
            query?: {
                /** @description Only features in this box: min longitude,min latitude,max longitude,max latitude, in degrees. Features without geometry are in none. */
                bbox?: string | null;
                /** @description `next` of the previous page. */
                cursor?: string | null;
                /** @description Only features of submaps with a stamp in this interval start/end; '..' for an open end. Or an instant. */
                datetime?: string | null;
                /** @description Most features on the page; `page_max` in GET /v1/limits if it is more. */
                limit?: number;
            };
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `landmarks` or `submaps`. */
                kind: "landmarks" | "submaps";
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/geo+json": Record<string, never>;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getFeature: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `id` of the feature: that of the submap, or SUBMAP:LANDMARK. */
                feature: string;
                /** @description `landmarks` or `submaps`. */
                kind: "landmarks" | "submaps";
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/geo+json": Record<string, never>;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getConformance: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": Record<string, never>;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getProblem: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path: {
                /** @description Last part of the problem's type. */
                slug: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": Record<string, never>;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getReadiness: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Readiness"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listCollections: {
        parameters: {
            query?: {
                /** @description `next` of the previous page. */
                cursor?: string | null;
                /** @description Entries on the page, at most 1000. */
                limit?: number | null;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["CollectionPage"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getCollection: {
        parameters: {
            query?: never;
            header?: {
                /** @description Entity tag of the copy that you have; 304 if it is current. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Collection"];
                };
            };
            /** @description Not modified. */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    putCollection: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
                /** @description Proceed only if the entity tag is one of these; * for any. */
                "if-match"?: string | null;
                /** @description Proceed only if the entity tag is none of these; * if nothing must exist. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["CollectionPut"];
            };
        };
        responses: {
            /** @description The collection exists and agrees with the body. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Collection"];
                };
            };
            /** @description The collection was created. */
            201: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Collection"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    deleteCollection: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
                /** @description Proceed only if the entity tag is one of these; * for any. */
                "if-match"?: string | null;
                /** @description Proceed only if the entity tag is none of these; * if nothing must exist. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    patchCollection: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
                /** @description Proceed only if the entity tag is one of these; * for any. */
                "if-match"?: string | null;
                /** @description Proceed only if the entity tag is none of these; * if nothing must exist. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["CollectionPatch"];
            };
        };
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Collection"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listConstraints: {
        parameters: {
            query?: {
                /** @description `next` of the previous page. */
                cursor?: string | null;
                /** @description All of them at once, in this format. Default: a page of JSON. */
                format?: ("ndjson" | "json" | "g2o" | "g2o_middle" | "matrices" | "tum" | "kitti") | null;
                /** @description Map frame in which vertices of g2o and poses of TUM and KITTI start. Default: that of most submaps. */
                frame_id?: string | null;
                /** @description Only matches, or only odometry. */
                kind?: ("match" | "odometry") | null;
                /** @description Entries on the page, at most 1000. */
                limit?: number | null;
                /** @description Only constraints in this state. */
                state?: ("active" | "stale" | "refused") | null;
                /** @description Only constraints of this submap. */
                submap?: string | null;
            };
            header?: never;
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ConstraintPage"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postConstraints: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["ConstraintsInput"];
            };
        };
        responses: {
            /** @description The job is accepted; `Location` is its path. */
            202: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    deleteConstraint: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `id` of the constraint. */
                constraint: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postCoregistration: {
        parameters: {
            query: {
                /** @description Unit of the azimuths. */
                angle?: ("deg" | "gon" | "rad") | null;
                /** @description Search each plot where it ought to be first: standard deviation of that, in metres. Default: search everywhere. */
                at_sigma?: number | null;
                /** @description Name of the column of azimuths from the plot's centre, clockwise from north, if it has no well-known name. */
                azimuth?: string | null;
                /** @description Name of the column of x of the plot's centre, if it has no well-known name. */
                centre_x?: string | null;
                /** @description Name of the column of y of the plot's centre, if it has no well-known name. */
                centre_y?: string | null;
                /** @description Coordinate reference system of the positions, such as EPSG:25832. */
                crs?: string | null;
                /** @description Name of the column of diameters at breast height, if it has no well-known name. */
                dbh?: string | null;
                /** @description Unit of the diameters. */
                dbh_unit?: ("cm" | "mm" | "m" | "in") | null;
                /** @description The decimal mark. */
                decimal?: ("point" | "comma") | null;
                /** @description Degrees to add to azimuths. */
                declination?: number | null;
                /** @description Name of the column of distances from the plot's centre, if it has no well-known name. */
                distance?: string | null;
                /** @description How far to search if a plot is not found. */
                effort?: "fast" | "full";
                /** @description Name of the file. Its suffix says the format. */
                file: string;
                /** @description Map frame that plots ought to be in. Default: the only one. */
                frame_id?: string | null;
                /** @description Bearing of the plots' y axes, in degrees clockwise from grid north of their system, or of the map if they name none. */
                heading?: number;
                /** @description Standard deviation of `heading`, in degrees. From 60 on, every heading is searched. */
                heading_sigma?: number;
                /** @description Name of the column of heights, if it has no well-known name. */
                height?: string | null;
                /** @description Unit of the heights. */
                height_unit?: ("m" | "ft" | "us-ft" | "cm" | "km") | null;
                /** @description Name of the column of the trees' ids or tags; of a point cloud, the dimension that numbers the trees, if it has no well-known name. */
                id?: string | null;
                /** @description Names of columns that are not used, with commas. */
                ignore?: string | null;
                /** @description Values of `status` of trees to read, with commas. */
                keep?: string | null;
                /** @description Layer of a GIS file, or sheet of a workbook. */
                layer?: string | null;
                /** @description Least confidence of a plot that is `matched`. */
                min_confidence?: number | null;
                /** @description Roughly how far trees are off in the map along each axis, in metres. Default: 0.3 to 1. */
                noise?: number | null;
                /** @description Read only this plot. */
                only?: string | null;
                /** @description Name of the column of plots; each plot is a place of its own, if it has no well-known name. */
                plot?: string | null;
                /** @description Name of the file in the archive that says where plots ought to be: plot, x, y. */
                positions?: string | null;
                /** @description Coordinate reference system of `positions`. Default: what the file names, then `crs`, then that of the map. */
                positions_crs?: string | null;
                /** @description Convert positions to this projected system. */
                project?: string | null;
                /** @description Side of the quadrats that lx and ly are measured in. */
                quadrat_size?: number | null;
                /** @description Seed of random choices. The same seed gives the same results. */
                seed?: number | null;
                /** @description Whether to leave out rows that cannot be used, and count them. */
                skip_bad?: boolean;
                /** @description Name of the column of slopes of the sight lines, if it has no well-known name. */
                slope?: string | null;
                /** @description Unit of the slopes. */
                slope_unit?: ("deg" | "gon" | "rad" | "percent") | null;
                /** @description Name of the column of species, if it has no well-known name. */
                species?: string | null;
                /** @description Name of the column of whether a tree is alive, if it has no well-known name. */
                status?: string | null;
                /** @description Unit of the positions. Also says that odd positions are right. */
                unit?: ("m" | "ft" | "us-ft" | "cm" | "km") | null;
                /** @description Name of the column of x, or easting, if it has no well-known name. */
                x?: string | null;
                /** @description Name of the column of y, or northing, if it has no well-known name. */
                y?: string | null;
            };
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        /** @description The bytes of one file of plots, or of a zip archive of several. gzip is accepted. */
        requestBody: {
            content: {
                "application/octet-stream": string;
            };
        };
        responses: {
            /** @description The job is accepted; `Location` is its path. */
            202: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getExport: {
        parameters: {
            query?: {
                /** @description Only submaps whose footprint overlaps this box, and their landmarks: min x,min y,max x,max y, metres, map frame. */
                bbox?: string | null;
                /** @description One row for each submap that has a tree, where overlapping submaps of a stand share it. */
                every?: boolean;
                /** @description Format of the file, instead of `Accept`, for browsers. */
                format?: ("csv" | "geojson" | "gpkg" | "parquet") | null;
                /** @description Only what is in this map frame. Needed if map frames have several coordinate reference systems, because one file has one. */
                frame_id?: string | null;
                /** @description Only landmarks or submaps of this session. */
                session?: string | null;
            };
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `landmarks` (trees), `submaps`, `matches` (stored queries), or `pairs` (of trees in these). */
                table: "landmarks" | "submaps" | "matches" | "pairs";
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/geo+json": Record<string, never>;
                    "application/geopackage+sqlite3": string;
                    "application/vnd.apache.parquet": string;
                    "text/csv": string;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postImport: {
        parameters: {
            query?: {
                /** @description `continue` past refused lines, or store `all` lines or none. */
                mode?: "continue" | "all";
                /** @description If an id has other content: replace it, skip the line, or refuse the line (`fail`). */
                on_conflict?: "replace" | "skip" | "fail";
            };
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        /** @description One submap on each line: the body of a PUT plus its `id`. gzip is accepted. */
        requestBody: {
            content: {
                "application/x-ndjson": string;
            };
        };
        responses: {
            /** @description The job is accepted; `Location` is its path. */
            202: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getLandmarks: {
        parameters: {
            query: {
                /** @description Only submaps whose footprint overlaps this box: min x,min y,max x,max y, metres, map frame. */
                bbox?: string | null;
                /** @description The map frame. */
                frame_id: string;
                /** @description Most positions. If there are more, every second, fourth, ... is sent. */
                limit?: number;
                /** @description Only submaps of this session. */
                session?: string | null;
            };
            header?: {
                /** @description Entity tag of the copy that you have; 304 if it is current. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/vnd.urquhart.landmark-columns": string;
                };
            };
            /** @description Not modified. */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postMap: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["MapInput"];
            };
        };
        responses: {
            /** @description The job is accepted; `Location` is its path. */
            202: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getMap: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `id` of the job that built the map. */
                map: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MapAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getMapLandmarks: {
        parameters: {
            query?: {
                /** @description Format of a file. Default: JSON. */
                format?: ("csv" | "geojson" | "gpkg" | "parquet") | null;
                /** @description Number of the part of the map; 1 is the largest one. */
                part?: number;
            };
            header?: never;
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `id` of the job that built the map. */
                map: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["PartTrees"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postMerge: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["MergeInput"];
            };
        };
        responses: {
            /** @description The job is accepted; `Location` is its path. */
            202: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getMerge: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `id` of the merge: that of its job. */
                merge: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MergeAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postOdometry: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["OdometryInput"];
            };
        };
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["OdometryReceipt"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postPoses: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["PosesInput"];
            };
        };
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["PosesAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listQueries: {
        parameters: {
            query?: {
                /** @description `next` of the previous page. */
                cursor?: string | null;
                /** @description Entries on the page, at most 1000. */
                limit?: number | null;
                /** @description Only queries with this verdict. */
                verdict?: ("matched" | "ambiguous" | "no_match") | null;
            };
            header?: never;
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["QueryPage"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    query: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["QueryInput"];
            };
        };
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["QueryAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getQuery: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `id` of the stored answer. */
                query: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["QueryAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getMatch: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `id` of the stored answer. */
                query: string;
                /** @description `rank` of the candidate. */
                rank: number;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["MatchAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getExplanation: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `id` of the stored answer. */
                query: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ExplanationAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    queryBatch: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["BatchInput"];
            };
        };
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["BatchAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postReindex: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The job is accepted; `Location` is its path. */
            202: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listSessions: {
        parameters: {
            query?: {
                /** @description `next` of the previous page. */
                cursor?: string | null;
                /** @description Entries on the page, at most 1000. */
                limit?: number | null;
            };
            header?: never;
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SessionPage"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    deleteSession: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description Name of the session. */
                session: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getSessionPoses: {
        parameters: {
            query?: never;
            header?: {
                /** @description Entity tag of the copy that you have; 304 if it is current. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description Name of the session. */
                session: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SessionPosesAnswer"];
                };
            };
            /** @description Not modified. */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listStands: {
        parameters: {
            query?: {
                /** @description `next` of the previous page. */
                cursor?: string | null;
                /** @description Entries on the page, at most 1000. */
                limit?: number | null;
            };
            header?: never;
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["StandPage"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getStand: {
        parameters: {
            query?: never;
            header?: {
                /** @description Entity tag of the copy that you have; 304 if it is current. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `name` of the stand. */
                stand: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Stand"];
                };
            };
            /** @description Not modified. */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    putStand: {
        parameters: {
            query: {
                /** @description Unit of the azimuths. */
                angle?: ("deg" | "gon" | "rad") | null;
                /** @description Name of the column of azimuths from the plot's centre, clockwise from north, if it has no well-known name. */
                azimuth?: string | null;
                /** @description Name of the column of x of the plot's centre, if it has no well-known name. */
                centre_x?: string | null;
                /** @description Name of the column of y of the plot's centre, if it has no well-known name. */
                centre_y?: string | null;
                /** @description Coordinate reference system of the positions, such as EPSG:25832. */
                crs?: string | null;
                /** @description Name of the column of diameters at breast height, if it has no well-known name. */
                dbh?: string | null;
                /** @description Unit of the diameters. */
                dbh_unit?: ("cm" | "mm" | "m" | "in") | null;
                /** @description The decimal mark. */
                decimal?: ("point" | "comma") | null;
                /** @description Degrees to add to azimuths. */
                declination?: number | null;
                /** @description Name of the column of distances from the plot's centre, if it has no well-known name. */
                distance?: string | null;
                /** @description Name of the file. Its suffix says the format. */
                file: string;
                /** @description Name of the column of heights, if it has no well-known name. */
                height?: string | null;
                /** @description Unit of the heights. */
                height_unit?: ("m" | "ft" | "us-ft" | "cm" | "km") | null;
                /** @description Name of the column of the trees' ids or tags; of a point cloud, the dimension that numbers the trees, if it has no well-known name. */
                id?: string | null;
                /** @description Names of columns that are not used, with commas. */
                ignore?: string | null;
                /** @description Values of `status` of trees to read, with commas. */
                keep?: string | null;
                /** @description Layer of a GIS file, or sheet of a workbook. */
                layer?: string | null;
                /** @description Whether each file, or each of its plots, is one submap. */
                one_submap?: boolean;
                /** @description Read only this plot. */
                only?: string | null;
                /** @description Name of the column of plots; each plot is a place of its own, if it has no well-known name. */
                plot?: string | null;
                /** @description Convert positions to this projected system. */
                project?: string | null;
                /** @description Side of the quadrats that lx and ly are measured in. */
                quadrat_size?: number | null;
                /** @description Radius of a submap, in metres. */
                radius?: number | null;
                /** @description Whether to leave out rows that cannot be used, and count them. */
                skip_bad?: boolean;
                /** @description Name of the column of slopes of the sight lines, if it has no well-known name. */
                slope?: string | null;
                /** @description Unit of the slopes. */
                slope_unit?: ("deg" | "gon" | "rad" | "percent") | null;
                /** @description Distance between neighbouring submaps, in metres. */
                spacing?: number | null;
                /** @description Name of the column of species, if it has no well-known name. */
                species?: string | null;
                /** @description Name of the column of whether a tree is alive, if it has no well-known name. */
                status?: string | null;
                /** @description Unit of the positions. Also says that odd positions are right. */
                unit?: ("m" | "ft" | "us-ft" | "cm" | "km") | null;
                /** @description Name of the column of x, or easting, if it has no well-known name. */
                x?: string | null;
                /** @description Name of the column of y, or northing, if it has no well-known name. */
                y?: string | null;
            };
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
                /** @description Proceed only if the entity tag is one of these; * for any. */
                "if-match"?: string | null;
                /** @description Proceed only if the entity tag is none of these; * if nothing must exist. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `name` of the stand. */
                stand: string;
            };
            cookie?: never;
        };
        /** @description The bytes of the file. gzip is accepted. */
        requestBody: {
            content: {
                "application/octet-stream": string;
            };
        };
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["StandReceipt"];
                };
            };
            /** @description The stand is new. */
            201: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["StandReceipt"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    deleteStand: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
                /** @description Proceed only if the entity tag is one of these; * for any. */
                "if-match"?: string | null;
                /** @description Proceed only if the entity tag is none of these; * if nothing must exist. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `name` of the stand. */
                stand: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    patchStand: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
                /** @description Proceed only if the entity tag is one of these; * for any. */
                "if-match"?: string | null;
                /** @description Proceed only if the entity tag is none of these; * if nothing must exist. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description `name` of the stand. */
                stand: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["StandMove"];
            };
        };
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Stand"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listSubmaps: {
        parameters: {
            query?: {
                /** @description Only submaps whose footprint overlaps this box: min x,min y,max x,max y, metres, map frame. */
                bbox?: string | null;
                /** @description `next` of the previous page. */
                cursor?: string | null;
                /** @description Only submaps with a stamp in this interval start/end; '..' for an open end. Or an instant. */
                datetime?: string | null;
                /** @description Only submaps whose `map_pose` is in this map frame. */
                frame_id?: string | null;
                /** @description Entries on the page, at most 1000. */
                limit?: number | null;
                /** @description Only submaps of this session. */
                session?: string | null;
            };
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SubmapPage"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postSubmap: {
        parameters: {
            query?: {
                /** @description Also search for this place among the submaps stored before; the same as `query: {}` in the body. */
                query?: boolean;
            };
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["ArrivingSubmap"];
            };
        };
        responses: {
            /** @description The submap was looked up and `not_stored`; `reason` says why. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SubmapReceipt"];
                };
            };
            /** @description The submap is stored; `Location` is its path. */
            201: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SubmapReceipt"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getSubmap: {
        parameters: {
            query?: never;
            header?: {
                /** @description Entity tag of the copy that you have; 304 if it is current. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description Id of the submap: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                submap: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Submap"];
                };
            };
            /** @description Not modified. */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    putSubmap: {
        parameters: {
            query?: {
                /** @description Also search for this place among the submaps stored before; the same as `query: {}` in the body. */
                query?: boolean;
            };
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
                /** @description Proceed only if the entity tag is one of these; * for any. */
                "if-match"?: string | null;
                /** @description Proceed only if the entity tag is none of these; * if nothing must exist. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description Id of the submap: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                submap: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["ArrivingSubmap"];
            };
        };
        responses: {
            /** @description The submap existed: `unchanged` or `replaced`. Or it was looked up and `not_stored`. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SubmapReceipt"];
                };
            };
            /** @description The submap is new. */
            201: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SubmapReceipt"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    deleteSubmap: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
                /** @description Proceed only if the entity tag is one of these; * for any. */
                "if-match"?: string | null;
                /** @description Proceed only if the entity tag is none of these; * if nothing must exist. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description Id of the submap: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                submap: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    patchSubmap: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
                /** @description Proceed only if the entity tag is one of these; * for any. */
                "if-match"?: string | null;
                /** @description Proceed only if the entity tag is none of these; * if nothing must exist. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description Id of the submap: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                submap: string;
            };
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["SubmapPatch"];
            };
        };
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Submap"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getTessellation: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
                /** @description Entity tag of the copy that you have; 304 if it is current. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description Id of the collection: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                collection: string;
                /** @description Id of the submap: 1 to 128 letters, digits, '.', '_', '~', '-'. */
                submap: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["TessellationAnswer"];
                };
            };
            /** @description Not modified. */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listJobs: {
        parameters: {
            query?: {
                /** @description Only jobs on this collection. */
                collection?: string | null;
                /** @description `next` of the previous page. */
                cursor?: string | null;
                /** @description Entries on the page, at most 1000. */
                limit?: number | null;
                /** @description Only jobs in this state. */
                state?: ("accepted" | "running" | "successful" | "failed" | "dismissed") | null;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobPage"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getJob: {
        parameters: {
            query?: {
                /** @description Seconds to wait for the end of the job before answering. */
                wait?: number;
            };
            header?: never;
            path: {
                /** @description `id` of the job. */
                job: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    deleteJob: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description `id` of the job. */
                job: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description The job will end after the work in progress. */
            202: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobAnswer"];
                };
            };
            /** @description Success. */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getJobErrors: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /** @description `id` of the job. */
                job: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/x-ndjson": string;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listJobFiles: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /** @description `id` of the job. */
                job: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["JobFileList"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getJobFile: {
        parameters: {
            query?: never;
            header?: never;
            path: {
                /** @description `name` of the file in the list. */
                file: string;
                /** @description `id` of the job. */
                job: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/octet-stream": string;
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getJobResults: {
        parameters: {
            query?: {
                /** @description Format of constraints. Default: ndjson. */
                format?: ("ndjson" | "json" | "g2o" | "g2o_middle" | "matrices") | null;
                /** @description With `format=g2o`: the map frame in which vertices start. Default: the frame of most submaps. */
                frame_id?: string | null;
            };
            header?: never;
            path: {
                /** @description `id` of the job. */
                job: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    /** @description How many constraints are stale. */
                    "X-Stale-Constraints"?: number;
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["ConstraintList"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getLimits: {
        parameters: {
            query?: never;
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["LimitsAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    listSnapshots: {
        parameters: {
            query?: {
                /** @description `next` of the previous page. */
                cursor?: string | null;
                /** @description Entries on the page, at most 1000. */
                limit?: number | null;
            };
            header?: never;
            path?: never;
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["SnapshotPage"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    postSnapshot: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path?: never;
            cookie?: never;
        };
        requestBody: {
            content: {
                "application/json": components["schemas"]["SnapshotInput"];
            };
        };
        responses: {
            /** @description The snapshot is checked and on the disk; `Location` is its path. */
            201: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Snapshot"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    getSnapshot: {
        parameters: {
            query?: never;
            header?: {
                /** @description Media types that you accept. */
                accept?: string | null;
                /** @description Entity tag of the copy that you have; 304 if it is current. */
                "if-none-match"?: string | null;
            };
            path: {
                /** @description `name` of the snapshot. */
                snapshot: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["Snapshot"];
                };
            };
            /** @description The requested range of the file. */
            206: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/vnd.sqlite3": string;
                };
            };
            /** @description Not modified. */
            304: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    deleteSnapshot: {
        parameters: {
            query?: never;
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path: {
                /** @description `name` of the snapshot. */
                snapshot: string;
            };
            cookie?: never;
        };
        requestBody?: never;
        responses: {
            /** @description Success. */
            204: {
                headers: {
                    [name: string]: unknown;
                };
                content?: never;
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
    readStemMap: {
        parameters: {
            query: {
                /** @description Unit of the azimuths. */
                angle?: ("deg" | "gon" | "rad") | null;
                /** @description Name of the column of azimuths from the plot's centre, clockwise from north, if it has no well-known name. */
                azimuth?: string | null;
                /** @description Name of the column of x of the plot's centre, if it has no well-known name. */
                centre_x?: string | null;
                /** @description Name of the column of y of the plot's centre, if it has no well-known name. */
                centre_y?: string | null;
                /** @description Coordinate reference system of the positions, such as EPSG:25832. */
                crs?: string | null;
                /** @description Name of the column of diameters at breast height, if it has no well-known name. */
                dbh?: string | null;
                /** @description Unit of the diameters. */
                dbh_unit?: ("cm" | "mm" | "m" | "in") | null;
                /** @description The decimal mark. */
                decimal?: ("point" | "comma") | null;
                /** @description Degrees to add to azimuths. */
                declination?: number | null;
                /** @description Name of the column of distances from the plot's centre, if it has no well-known name. */
                distance?: string | null;
                /** @description Name of the file. Its suffix says the format. */
                file: string;
                /** @description Name of the column of heights, if it has no well-known name. */
                height?: string | null;
                /** @description Unit of the heights. */
                height_unit?: ("m" | "ft" | "us-ft" | "cm" | "km") | null;
                /** @description Name of the column of the trees' ids or tags; of a point cloud, the dimension that numbers the trees, if it has no well-known name. */
                id?: string | null;
                /** @description Names of columns that are not used, with commas. */
                ignore?: string | null;
                /** @description Values of `status` of trees to read, with commas. */
                keep?: string | null;
                /** @description Layer of a GIS file, or sheet of a workbook. */
                layer?: string | null;
                /** @description Read only this plot. */
                only?: string | null;
                /** @description Name of the column of plots; each plot is a place of its own, if it has no well-known name. */
                plot?: string | null;
                /** @description Convert positions to this projected system. */
                project?: string | null;
                /** @description Side of the quadrats that lx and ly are measured in. */
                quadrat_size?: number | null;
                /** @description Whether to leave out rows that cannot be used, and count them. */
                skip_bad?: boolean;
                /** @description Name of the column of slopes of the sight lines, if it has no well-known name. */
                slope?: string | null;
                /** @description Unit of the slopes. */
                slope_unit?: ("deg" | "gon" | "rad" | "percent") | null;
                /** @description Name of the column of species, if it has no well-known name. */
                species?: string | null;
                /** @description Name of the column of whether a tree is alive, if it has no well-known name. */
                status?: string | null;
                /** @description Unit of the positions. Also says that odd positions are right. */
                unit?: ("m" | "ft" | "us-ft" | "cm" | "km") | null;
                /** @description Name of the column of x, or easting, if it has no well-known name. */
                x?: string | null;
                /** @description Name of the column of y, or northing, if it has no well-known name. */
                y?: string | null;
            };
            header?: {
                /** @description A name of your choice for this request. A repetition with the same name is not carried out again: it gets the first answer. */
                "idempotency-key"?: string | null;
            };
            path?: never;
            cookie?: never;
        };
        /** @description The bytes of the file. gzip is accepted. */
        requestBody: {
            content: {
                "application/octet-stream": string;
            };
        };
        responses: {
            /** @description Success. */
            200: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/json": components["schemas"]["StemMapAnswer"];
                };
            };
            /** @description A problem document. */
            default: {
                headers: {
                    [name: string]: unknown;
                };
                content: {
                    "application/problem+json": components["schemas"]["Problem"];
                };
            };
        };
    };
}
