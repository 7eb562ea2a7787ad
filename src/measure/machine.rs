//! What a measurement was made on: figures without it mean nothing.

use serde_json::{Value, json};
use std::{
    fs,
    time::{SystemTime, UNIX_EPOCH},
};

/// The machine now. What the system does not tell is null: processor, clock rates and load are read from Linux's files.
pub fn machine() -> Value {
    let read = |path: &str| fs::read_to_string(path).ok().map(|text| text.trim().to_owned());
    let cpuinfo = read("/proc/cpuinfo").unwrap_or_default();
    let values = |key: &str| {
        let of_key = |line: &str| {
            let (name, value) = line.split_once(':')?;
            (name.trim() == key).then(|| value.trim().to_owned())
        };
        cpuinfo.lines().filter_map(of_key).collect::<Vec<_>>()
    };
    let clocks: Vec<f64> = values("cpu MHz").iter().filter_map(|clock| clock.parse().ok()).collect();
    let load = read("/proc/loadavg").and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    json!({
        "processor": values("model name").first(),
        "threads": std::thread::available_parallelism().ok().map(usize::from),
        "clock_mhz": clocks,
        "governor": read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
        "load_average": load,
        "system": std::env::consts::OS,
        "architecture": std::env::consts::ARCH,
        "kernel": read("/proc/sys/kernel/osrelease"),
        "unix_time": SystemTime::now().duration_since(UNIX_EPOCH).ok().map(|time| time.as_secs()),
    })
}
