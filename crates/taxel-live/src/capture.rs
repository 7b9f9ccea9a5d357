//! UDP datagrams in, counted.
