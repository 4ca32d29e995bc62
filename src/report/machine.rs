//! What the operating system knows of this process and its host. Linux tells it in `/proc`; elsewhere nothing is known.

use std::fs;

/// Clock ticks per second in `/proc/self/stat`: fixed to 100 in the interface of Linux on every architecture in use.
const TICKS_PER_SECOND: f64 = 100.0;

/// The greatest memory this process has held, bytes.
pub fn peak_memory_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    // VmHWM:     12345 kB
    let kilobytes = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * kilobytes.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}

/// Processor time of all threads of this process, in its own code and in the kernel, s.
pub fn cpu_seconds() -> Option<f64> {
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    // the name of the program, in brackets, may hold blanks; behind it come field 3 and on, utime and stime are 14, 15
    let fields: Vec<&str> = stat[stat.rfind(')')? + 1..].split_whitespace().collect();
    let ticks = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
    Some((ticks(14)? + ticks(15)?) / TICKS_PER_SECOND)
}

/// The name of the processor.
pub fn cpu_name() -> Option<String> {
    let info = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = info.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
