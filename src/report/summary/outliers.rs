//! Markers that a robust loss set aside, gathered over the frames.

use super::count;
use crate::report::frame::Outlier;
use std::fmt;

/// Markers shown, those set aside most often.
const SHOWN: usize = 5;

/// `Display` is a line; nothing where there was none.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outliers {
    /// Name, frames, and the greatest distance in mm of each.
    markers: Vec<(String, usize, f64)>,
}

impl Outliers {
    /// Adds those of a frame.
    pub fn add(&mut self, outliers: &[Outlier<'_>]) {
        for outlier in outliers {
            match self.markers.iter_mut().find(|(name, ..)| name == outlier.name) {
                Some((_, frames, greatest)) => {
                    *frames += 1;
                    *greatest = greatest.max(outlier.distance_mm);
                }
                None => self.markers.push((outlier.name.to_owned(), 1, outlier.distance_mm)),
            }
        }
    }
}

impl fmt::Display for Outliers {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.markers.is_empty() {
            return Ok(());
        }
        let mut all: Vec<_> = self.markers.iter().collect();
        all.sort_by_key(|(_, frames, _)| std::cmp::Reverse(*frames));
        let told = all.iter().take(SHOWN).map(|(name, frames, greatest)| {
            format!("{name} in {} (up to {greatest:.2} mm)", count(*frames, "frame"))
        });
        let told: Vec<String> = told.collect();
        let more = if all.len() > SHOWN { ", ..." } else { "" };
        writeln!(out, "  outliers that the loss sets aside (tables/outliers.csv): {}{more}", told.join(", "))
    }
}
