//! Datagrams to detections, as they come.
