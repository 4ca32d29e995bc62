//! Writes C3D, TRC and CSV files as other programs do.

use std::fmt::Write;

/// Tracks: labels, times (s), positions per frame; `None` where lost.
pub struct Tracks {
    pub labels: Vec<String>,
    pub rate: f64,
    pub frames: Vec<Vec<Option<[f64; 3]>>>,
}

/// Whose numbers a C3D file has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Processor {
    Intel,
    Dec,
    Mips,
}

impl Processor {
    fn code(self) -> u8 {
        match self {
            Processor::Intel => 84,
            Processor::Dec => 85,
            Processor::Mips => 86,
        }
    }

    fn word(self, value: i16) -> [u8; 2] {
        if self == Processor::Mips { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    fn float(self, value: f32) -> [u8; 4] {
        match self {
            Processor::Intel => value.to_le_bytes(),
            Processor::Mips => value.to_be_bytes(),
            Processor::Dec => {
                let [a, b, c, d] = (value * 4.0).to_le_bytes();
                [c, d, a, b]
            }
        }
    }
}

/// A C3D file in millimetres with two analogue channels; of floats, or of integers with this scale.
pub fn c3d(tracks: &Tracks, processor: Processor, scale: Option<f32>) -> Vec<u8> {
    let points = tracks.labels.len();
    let (word, float) = (|v: usize| processor.word(v as i16), |v: f32| processor.float(v));
    let scale_value = scale.unwrap_or(-1.0);
    let width = tracks.labels.iter().map(String::len).max().unwrap();
    let labels: Vec<u8> = tracks.labels.iter().flat_map(|l| format!("{l:width$}").into_bytes()).collect();
    let mut parameters = vec![1, 0x50, 2, processor.code()];
    parameters.extend([5, 0xff]);
    parameters.extend(b"POINT");
    parameters.extend(word(3));
    parameters.push(0);
    let mut parameter = |name: &str, kind: i8, sizes: &[u8], data: &[u8]| {
        parameters.extend([name.len() as u8, 1]);
        parameters.extend(name.as_bytes());
        parameters.extend(word(2 + 1 + 1 + sizes.len() + data.len() + 1));
        parameters.extend([kind as u8, sizes.len() as u8]);
        parameters.extend(sizes);
        parameters.extend(data);
        parameters.push(0);
    };
    const DATA_BLOCK: usize = 4;
    parameter("USED", 2, &[], &word(points));
    parameter("SCALE", 4, &[], &float(scale_value));
    parameter("RATE", 4, &[], &float(tracks.rate as f32));
    parameter("DATA_START", 2, &[], &word(DATA_BLOCK));
    parameter("FRAMES", 2, &[], &word(tracks.frames.len()));
    parameter("LABELS", -1, &[width as u8, points as u8], &labels);
    parameter("UNITS", -1, &[2], b"mm");
    parameters.extend([0, 0]);
    assert!(parameters.len() <= 1024);
    parameters.resize(1024, 0);

    let mut header = vec![2, 0x50];
    for value in [points, 2, 1, tracks.frames.len(), 0] {
        header.extend(word(value));
    }
    header.extend(float(scale_value));
    header.extend(word(DATA_BLOCK));
    header.extend(word(2));
    header.extend(float(tracks.rate as f32));
    header.resize(512, 0);

    let mut bytes = [header, parameters].concat();
    for frame in &tracks.frames {
        for position in frame {
            let [x, y, z] = position.unwrap_or_default().map(|x| x as f32);
            match scale {
                None => {
                    let residual = if position.is_some() { 0.0 } else { -1.0 };
                    [x, y, z, residual].iter().for_each(|v| bytes.extend(float(*v)));
                }
                Some(scale) => {
                    let whole = |x: f32| (x / scale).round() as i16;
                    let residual = if position.is_some() { 0 } else { -1 };
                    [whole(x), whole(y), whole(z), residual].iter().for_each(|v| bytes.extend(processor.word(*v)));
                }
            }
        }
        for _ in 0..2 {
            match scale {
                None => bytes.extend(float(0.5)),
                Some(_) => bytes.extend(word(7)),
            }
        }
    }
    bytes
}

fn time(tracks: &Tracks, frame: usize) -> f64 {
    frame as f64 / tracks.rate
}

/// A TRC file in millimetres.
pub fn trc(tracks: &Tracks) -> String {
    let (rate, frames, markers) = (tracks.rate, tracks.frames.len(), tracks.labels.len());
    let mut text = format!(
        "PathFileType\t4\t(X/Y/Z)\ttest.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\t\
         OrigDataStartFrame\tOrigNumFrames\n{rate}\t{rate}\t{frames}\t{markers}\tmm\t{rate}\t1\t{frames}\nFrame#\tTime\t{}\t\t\n",
        tracks.labels.join("\t\t\t")
    );
    let axes = (1..=markers).map(|k| format!("X{k}\tY{k}\tZ{k}")).collect::<Vec<_>>().join("\t");
    writeln!(text, "\t\t{axes}\n").unwrap();
    for (k, frame) in tracks.frames.iter().enumerate() {
        write!(text, "{}\t{:?}", k + 1, time(tracks, k)).unwrap();
        for position in frame {
            match position {
                Some([x, y, z]) => write!(text, "\t{x:?}\t{y:?}\t{z:?}").unwrap(),
                None => text.push_str("\t\t\t"),
            }
        }
        text.push('\n');
    }
    text
}

/// A wide CSV file.
pub fn wide(tracks: &Tracks, unit: &str) -> String {
    let column = |label: &String| format!("{label}_x{unit},{label}_y{unit},{label}_z{unit}");
    let mut text = format!("time_s,{}\n", tracks.labels.iter().map(column).collect::<Vec<_>>().join(","));
    for (k, frame) in tracks.frames.iter().enumerate() {
        write!(text, "{:?}", time(tracks, k)).unwrap();
        for position in frame {
            match position {
                Some([x, y, z]) => write!(text, ",{x:?},{y:?},{z:?}").unwrap(),
                None => text.push_str(",,,"),
            }
        }
        text.push('\n');
    }
    text
}

/// A long CSV file with a column that is none of ours.
pub fn long(tracks: &Tracks) -> String {
    let mut text = String::from("frame,time_s,name,x_mm,y_mm,z_mm,distance_mm\n");
    for (k, frame) in tracks.frames.iter().enumerate() {
        for (label, position) in tracks.labels.iter().zip(frame) {
            write!(text, "{k},{:?},\"{label}\"", time(tracks, k)).unwrap();
            match position {
                Some([x, y, z]) => writeln!(text, ",{x:?},{y:?},{z:?},0.1").unwrap(),
                None => writeln!(text, ",,,,").unwrap(),
            }
        }
    }
    text
}
