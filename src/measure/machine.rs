//! What a measurement was made on: figures without it mean nothing.

use serde_json::{Value, json};
use std::{
    fs,
    path::Path,
    process::Command,
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
        "graphics": graphics(Path::new("/sys/class/drm"), nvidia().as_deref()),
        "system": std::env::consts::OS,
        "architecture": std::env::consts::ARCH,
        "kernel": read("/proc/sys/kernel/osrelease"),
        "unix_time": SystemTime::now().duration_since(UNIX_EPOCH).ok().map(|time| time.as_secs()),
    })
}

/// Where the drivers of Linux say a card's clock rate in MHz, under its folder: amdgpu marks the present one of several
/// rates with a star, i915 (of today and of older kernels) and xe write it alone.
const CARD_CLOCKS: [&str; 4] =
    ["device/pp_dpm_sclk", "gt/gt0/rps_act_freq_mhz", "gt_act_freq_mhz", "device/tile0/gt0/freq0/act_freq"];

/// Graphics processors whose clock rates are told, in MHz now: the cards of `folder`, laid out as Linux's
/// `/sys/class/drm`, and those that NVIDIA's program lists, by its lines `name, clock, clock of the memory`. Empty without any.
pub fn graphics(folder: &Path, nvidia: Option<&str>) -> Vec<Value> {
    let mut cards: Vec<_> = fs::read_dir(folder).into_iter().flatten().flatten().map(|card| card.path()).collect();
    cards.sort();
    let mut found = Vec::new();
    for card in cards {
        let clock = CARD_CLOCKS.iter().find_map(|file| present_clock(&fs::read_to_string(card.join(file)).ok()?));
        if let (Some(clock), Some(name)) = (clock, card.file_name()) {
            found.push(json!({ "name": name.to_string_lossy(), "clock_mhz": clock, "memory_clock_mhz": null }));
        }
    }
    for line in nvidia.into_iter().flat_map(str::lines) {
        // A name may have commas, a clock has none.
        let mut fields = line.rsplitn(3, ',').map(str::trim);
        if let (Some(memory), Some(clock), Some(name)) = (fields.next(), fields.next(), fields.next()) {
            let number = |text: &str| text.parse::<f64>().ok();
            found.push(json!({ "name": name, "clock_mhz": number(clock), "memory_clock_mhz": number(memory) }));
        }
    }
    found
}

fn present_clock(text: &str) -> Option<f64> {
    let starred = text.lines().find(|line| line.trim_end().ends_with('*'));
    let rate = match starred {
        Some(line) => line.split_once(':')?.1.trim().trim_end_matches('*').trim().to_ascii_lowercase(),
        None => text.trim().to_owned(),
    };
    rate.trim_end_matches("mhz").parse().ok()
}

/// What NVIDIA's program says of clocks, where there is one.
fn nvidia() -> Option<String> {
    let query = ["--query-gpu=name,clocks.sm,clocks.mem", "--format=csv,noheader,nounits"];
    let output = Command::new("nvidia-smi").args(query).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}
