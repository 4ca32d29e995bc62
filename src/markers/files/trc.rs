//! TRC: the tables of Motion Analysis and OpenSim, tab-separated text.
//!
//! ```text
//! PathFileType  4  (X/Y/Z)  name.trc
//! DataRate  CameraRate  NumFrames  NumMarkers  Units  OrigDataRate  OrigDataStartFrame  OrigNumFrames
//! 60  60  300  12  mm  60  1  300
//! Frame#  Time  M01      M02
//!               X1 Y1 Z1 X2 Y2 Z2
//!
//! 1  0.000  12.1 3.0 55.2 ...
//! ```
//!
//! (<https://opensimconfluence.atlassian.net/wiki/spaces/OpenSim/pages/53089977/Marker+.trc+Files>)

use super::super::format::Sample;
use super::{FileFormat, Tracks, Wrong, lines, number, sample, stamp_ns};

pub(super) struct Trc;

type Result<T> = std::result::Result<T, Wrong>;

impl FileFormat for Trc {
    fn name(&self) -> &'static str {
        "trc"
    }

    fn extension(&self) -> &'static str {
        "trc"
    }

    fn read(&self, bytes: &[u8], allow_truncated: bool) -> Result<Tracks> {
        let (lines, mut truncated) = lines(bytes, allow_truncated)?;
        let header = |index: usize, what: &str| {
            let line = lines.get(index).map(|(_, line)| line.split('\t').map(str::trim).collect::<Vec<_>>());
            line.ok_or_else(|| Wrong::line(index + 1, format!("the file ends before its {what}")))
        };
        if header(0, "first line")?[0] != "PathFileType" {
            return Err(Wrong::line(1, "a TRC file starts with `PathFileType`"));
        }
        let (names, values) = (header(1, "names of settings")?, header(2, "settings")?);
        let setting = |name: &str| {
            let place = names.iter().position(|known| *known == name);
            place.and_then(|place| values.get(place)).filter(|value| !value.is_empty()).copied()
        };
        let count = |name: &str| {
            let value = setting(name).and_then(|value| value.parse::<usize>().ok());
            value.ok_or_else(|| Wrong::line(3, format!("`{name}` is missing, or no whole number")))
        };
        let (frames, markers) = (count("NumFrames")?, count("NumMarkers")?);
        let labels = header(3, "labels")?;
        if labels.first() != Some(&"Frame#") || labels.get(1) != Some(&"Time") {
            return Err(Wrong::line(4, "the labels start with `Frame#` and `Time`"));
        }
        let labels: Vec<String> =
            labels.iter().skip(2).filter(|label| !label.is_empty()).map(|l| l.to_string()).collect();
        if labels.len() != markers {
            return Err(Wrong::line(4, format!("there are {} labels, NumMarkers says {markers}", labels.len())));
        }
        let axes = header(4, "axes")?;
        let axes: Vec<&str> = axes.into_iter().filter(|axis| !axis.is_empty()).collect();
        let expected = |k: usize| format!("{}{}", ["X", "Y", "Z"][k % 3], k / 3 + 1);
        if axes.len() != 3 * markers || axes.iter().enumerate().any(|(k, axis)| *axis != expected(k)) {
            return Err(Wrong::line(5, format!("the axes are not X1, Y1, Z1 to Z{markers}")));
        }
        let mut tracks =
            Tracks { units: setting("Units").map(str::to_owned).into_iter().collect(), ..Tracks::default() };
        let mut last: Option<(f64, f64)> = None;
        for (line, text) in lines.iter().skip(5).filter(|(_, text)| !text.trim().is_empty()) {
            let line = *line;
            let mut cells: Vec<&str> = text.split('\t').collect();
            // writers close a row with a tab
            if cells.len() == 3 * markers + 3 && cells.last().is_some_and(|cell| cell.trim().is_empty()) {
                cells.pop();
            }
            if cells.len() != 3 * markers + 2 {
                return Err(Wrong::line(line, format!("the row has {} cells, not {}", cells.len(), 3 * markers + 2)));
            }
            let numbers: Vec<Option<f64>> =
                cells.iter().enumerate().map(|(k, cell)| number(cell, line, k)).collect::<Result<_>>()?;
            let (Some(frame), Some(time)) = (numbers[0], numbers[1]) else {
                return Err(Wrong::line(line, "the row has no frame number or no time"));
            };
            if last.is_some_and(|(before, earlier)| frame != before + 1.0 || time <= earlier || time.is_nan()) {
                return Err(Wrong::line(line, format!("frame {frame} at {time} s does not follow the row before")));
            }
            last = Some((frame, time));
            let of = |(k, label): (usize, &String)| -> Result<(String, Sample)> {
                let at = 2 + 3 * k;
                Ok((label.clone(), sample([numbers[at], numbers[at + 1], numbers[at + 2]], line, label)?))
            };
            tracks.frames.push(labels.iter().enumerate().map(of).collect::<Result<_>>()?);
            tracks.stamps_ns.push(stamp_ns(time, || format!("line {line}"))?);
        }
        let found = tracks.frames.len();
        if found > frames || (found < frames && !allow_truncated) {
            return Err(Wrong::line(lines.len(), format!("the file has {found} frames, NumFrames says {frames}")));
        }
        truncated |= found < frames;
        Ok(Tracks { truncated, ..tracks })
    }
}
