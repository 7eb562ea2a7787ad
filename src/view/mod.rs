//! Ways to look into a space while it is drawn.

pub mod xr;
