//! C3D: the binary file of optical motion capture (<https://www.c3d.org/docs/C3D_User_Guide.pdf>).
//!
//! Blocks of 512 bytes: a header, parameters in groups, then for every frame the points (x, y, z and a word with the residual,
//! negative where the point is lost) and the analogue channels. Numbers are 16-bit integers with a scale, or floats where
//! the scale is negative; of Intel, DEC or MIPS processors.

use std::collections::BTreeMap;

use super::super::format::Sample;
use super::{FileFormat, Tracks, Wrong, stamp_ns};

pub(super) struct C3d;

type Result<T> = std::result::Result<T, Wrong>;

const BLOCK: usize = 512;
/// Second byte of the header and of the parameters.
const KEY: u8 = 0x50;

/// Whose numbers.
#[derive(Clone, Copy, PartialEq)]
enum Processor {
    Intel,
    Dec,
    Mips,
}

impl Processor {
    fn word(self, bytes: [u8; 2]) -> i16 {
        match self {
            Processor::Intel | Processor::Dec => i16::from_le_bytes(bytes),
            Processor::Mips => i16::from_be_bytes(bytes),
        }
    }

    fn float(self, [a, b, c, d]: [u8; 4]) -> f32 {
        match self {
            Processor::Intel => f32::from_le_bytes([a, b, c, d]),
            Processor::Mips => f32::from_be_bytes([a, b, c, d]),
            // the two words change places, and the exponent is larger by two
            Processor::Dec => f32::from_le_bytes([c, d, a, b]) / 4.0,
        }
    }
}

/// The bytes of a file, with what is asked for beyond their end told as a place.
#[derive(Clone, Copy)]
struct File<'a> {
    bytes: &'a [u8],
    processor: Processor,
}

impl<'a> File<'a> {
    fn part(self, at: usize, length: usize) -> Result<&'a [u8]> {
        let part = at.checked_add(length).and_then(|end| self.bytes.get(at..end));
        part.ok_or_else(|| {
            Wrong::byte(
                at,
                format!("the file ends {} bytes too early here", (at + length).saturating_sub(self.bytes.len())),
            )
        })
    }

    fn byte(self, at: usize) -> Result<u8> {
        self.part(at, 1).map(|part| part[0])
    }

    fn word(self, at: usize) -> Result<i16> {
        self.part(at, 2).map(|part| self.processor.word([part[0], part[1]]))
    }

    fn unsigned(self, at: usize) -> Result<usize> {
        self.word(at).map(|word| usize::from(word as u16))
    }

    fn float(self, at: usize) -> Result<f64> {
        self.part(at, 4).map(|p| f64::from(self.processor.float([p[0], p[1], p[2], p[3]])))
    }
}

/// A parameter: kind (-1 text, 1 bytes, 2 words, 4 floats), dimensions, place of its data.
struct Parameter {
    kind: i8,
    sizes: Vec<usize>,
    at: usize,
}

impl Parameter {
    fn count(&self) -> usize {
        self.sizes.iter().product()
    }

    /// The first number.
    fn number(&self, file: File<'_>) -> Option<f64> {
        match self.kind {
            2 if self.count() > 0 => file.unsigned(self.at).ok().map(|word| word as f64),
            4 if self.count() > 0 => file.float(self.at).ok(),
            _ => None,
        }
    }

    /// Texts without the blanks that fill them.
    fn texts(&self, file: File<'_>) -> Vec<String> {
        let length = self.sizes.first().copied().unwrap_or(0);
        let texts = self.sizes.iter().skip(1).product::<usize>();
        let text = |k: usize| {
            let bytes = file.part(self.at + k * length, length).unwrap_or(&[]);
            String::from_utf8_lossy(bytes).trim_matches([' ', '\0']).to_owned()
        };
        if self.kind == -1 { (0..texts).map(text).collect() } else { Vec::new() }
    }
}

/// Parameters by `GROUP:NAME`.
type Parameters = BTreeMap<String, Parameter>;

fn parameters(file: File<'_>, start: usize, end: usize) -> Result<Parameters> {
    let mut groups: BTreeMap<i8, String> = BTreeMap::new();
    let mut found: Vec<(i8, String, Parameter)> = Vec::new();
    let mut at = start + 4;
    while at < end {
        let length = usize::from((file.byte(at)? as i8).unsigned_abs());
        let group = file.byte(at + 1)? as i8;
        if length == 0 {
            break;
        }
        let name = String::from_utf8_lossy(file.part(at + 2, length)?).to_uppercase();
        let offset_at = at + 2 + length;
        let offset = file.unsigned(offset_at)?;
        if group < 0 {
            groups.insert(-group.max(-127), name);
        } else {
            let kind = file.byte(offset_at + 2)? as i8;
            let dimensions = usize::from(file.byte(offset_at + 3)?);
            if ![-1, 1, 2, 4].contains(&kind) || dimensions > 7 {
                return Err(Wrong::byte(offset_at + 2, format!("parameter `{name}` has no known kind")));
            }
            let sizes = file.part(offset_at + 4, dimensions)?.iter().map(|size| usize::from(*size)).collect();
            let parameter = Parameter { kind, sizes, at: offset_at + 4 + dimensions };
            let bytes =
                parameter.sizes.iter().try_fold(usize::from(kind.unsigned_abs()), |all, n| all.checked_mul(*n));
            if bytes.is_none_or(|bytes| parameter.at + bytes > end) {
                return Err(Wrong::byte(at, format!("parameter `{name}` does not fit into the parameters")));
            }
            found.push((group, name, parameter));
        }
        match offset {
            0 => break,
            offset => at = offset_at + offset,
        }
    }
    let named = found.into_iter().filter_map(|(group, name, p)| Some((format!("{}:{name}", groups.get(&group)?), p)));
    Ok(named.collect())
}

impl FileFormat for C3d {
    fn name(&self) -> &'static str {
        "c3d"
    }

    fn extension(&self) -> &'static str {
        "c3d"
    }

    fn read(&self, bytes: &[u8], allow_truncated: bool) -> Result<Tracks> {
        let bare = File { bytes, processor: Processor::Intel };
        bare.part(0, BLOCK)?;
        if bytes[1] != KEY || bytes[0] == 0 {
            return Err(Wrong::byte(0, "this is not the header of a C3D file"));
        }
        let start = (usize::from(bytes[0]) - 1) * BLOCK;
        let processor = match bare.byte(start + 3)? {
            84 => Processor::Intel,
            85 => Processor::Dec,
            86 => Processor::Mips,
            other => return Err(Wrong::byte(start + 3, format!("processor {other} is none of 84, 85, 86"))),
        };
        let file = File { bytes, processor };
        let end = start + usize::from(file.byte(start + 2)?) * BLOCK;
        file.part(start, end - start)?;
        let parameters = parameters(file, start, end)?;
        let number = |name: &str| parameters.get(name).and_then(|parameter| parameter.number(file));

        let points = file.unsigned(2)?;
        let analogue = file.unsigned(4)?;
        let (first, last) = (file.unsigned(6)?, file.unsigned(8)?);
        let scale = file.float(12)?;
        let data = file.unsigned(16)?.checked_sub(1).map(|blocks| blocks * BLOCK);
        let data = data
            .filter(|data| *data >= end)
            .ok_or_else(|| Wrong::byte(16, "the data start inside the parameters"))?;
        let rate = file.float(20)?;
        let agrees = |name: &str, header: f64, tolerance: f64| match number(name) {
            Some(value) if (value - header).abs() > tolerance => {
                Err(Wrong::byte(0, format!("the header says {header}, parameter {name} {value}")))
            }
            _ => Ok(()),
        };
        agrees("POINT:USED", points as f64, 0.0)?;
        agrees("POINT:DATA_START", (data / BLOCK + 1) as f64, 0.0)?;
        agrees("POINT:RATE", rate, 1e-3 * rate.abs())?;
        agrees("POINT:SCALE", scale, 1e-6 * scale.abs())?;
        if !(rate > 0.0 && rate.is_finite() && scale.is_finite() && scale != 0.0) {
            return Err(Wrong::byte(12, format!("a frame rate of {rate} Hz and a scale of {scale} are none")));
        }
        let frames = frames(file, &parameters, first, last)?;
        let size = if scale < 0.0 { 4 } else { 2 };
        let stride = (4 * points + analogue) * size;
        let held = bytes.len().saturating_sub(data).checked_div(stride).unwrap_or(0);
        if held < frames && !allow_truncated {
            let place = data + held * stride;
            return Err(Wrong::byte(place, format!("the file is cut short: {held} of {frames} frames are whole")));
        }
        let frames_read = frames.min(held);
        let left = bytes.len() - data.min(bytes.len()) - frames_read * stride;
        if held >= frames && left >= 2 * BLOCK && left >= stride {
            return Err(Wrong::byte(data, format!("{left} bytes are left behind {frames} frames of {stride} bytes")));
        }
        let labels = labels(file, &parameters, points);
        let mut tracks = Tracks { truncated: frames_read < frames, ..Tracks::default() };
        tracks.units.extend(parameters.get("POINT:UNITS").map(|units| {
            // one text, written as a list of its letters or as a list of one text
            units.texts(file).first().cloned().unwrap_or_else(|| {
                String::from_utf8_lossy(file.part(units.at, units.count()).unwrap_or(&[])).trim().to_owned()
            })
        }));
        tracks.units.retain(|unit| !unit.is_empty());
        for frame in 0..frames_read {
            let at = data + frame * stride;
            let point = |(k, label): (usize, &String)| {
                let at = at + 4 * size * k;
                let value = |c: usize| -> Result<f64> {
                    if scale < 0.0 {
                        file.float(at + 4 * c)
                    } else {
                        file.word(at + 2 * c).map(|w| f64::from(w) * scale)
                    }
                };
                let residual = if scale < 0.0 { value(3)? } else { f64::from(file.word(at + 6)?) };
                let sample = if residual < 0.0 {
                    Sample::Invalid
                } else {
                    Sample::Position([value(0)?, value(1)?, value(2)?])
                };
                Ok((label.clone(), sample))
            };
            tracks.frames.push(labels.iter().enumerate().map(point).collect::<Result<_>>()?);
            let number = (first.max(1) - 1 + frame) as f64;
            tracks.stamps_ns.push(stamp_ns(number / rate, || format!("byte {at}"))?);
        }
        Ok(tracks)
    }
}

/// How many frames there are: the header counts to 65535, longer takes say so in parameters.
fn frames(file: File<'_>, parameters: &Parameters, first: usize, last: usize) -> Result<usize> {
    let double = |name: &str| {
        let parameter = parameters.get(name).filter(|p| p.kind == 2 && p.count() == 2)?;
        Some(file.unsigned(parameter.at).ok()? + (file.unsigned(parameter.at + 2).ok()? << 16))
    };
    if let (Some(start), Some(end)) = (double("TRIAL:ACTUAL_START_FIELD"), double("TRIAL:ACTUAL_END_FIELD"))
        && end >= start
        && end > 65_535
    {
        return Ok(end - start + 1);
    }
    let long = parameters.get("POINT:LONG_FRAMES").and_then(|p| p.number(file)).filter(|frames| *frames > 65_535.0);
    if let Some(long) = long {
        return Ok(long as usize);
    }
    let count = (last + 1).checked_sub(first).filter(|count| *count > 0);
    let count =
        count.ok_or_else(|| Wrong::byte(6, format!("the last frame {last} lies before the first, {first}")))?;
    match parameters.get("POINT:FRAMES").and_then(|p| p.number(file)) {
        Some(frames) if frames != count as f64 && count < 65_535 => {
            Err(Wrong::byte(6, format!("the header counts {count} frames, parameter POINT:FRAMES {frames}")))
        }
        _ => Ok(count),
    }
}

/// One label per point, empty where the file has none.
fn labels(file: File<'_>, parameters: &Parameters, points: usize) -> Vec<String> {
    let mut labels = Vec::new();
    for number in 1.. {
        let name = if number == 1 { "POINT:LABELS".to_owned() } else { format!("POINT:LABELS{number}") };
        match parameters.get(&name) {
            Some(list) if labels.len() < points => labels.extend(list.texts(file)),
            _ => break,
        }
    }
    labels.resize(points, String::new());
    labels
}
