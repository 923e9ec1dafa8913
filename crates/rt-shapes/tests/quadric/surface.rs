//! Surface records.
