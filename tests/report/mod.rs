//! What a run leaves behind: is it whole, is it exact, and does it survive a crash?

mod contact;
mod files;
mod model;
mod shapes;
mod summaries;
mod support;
mod tables;
mod vtu_reader;
