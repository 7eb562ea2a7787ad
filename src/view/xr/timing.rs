//! What frames cost.

use super::frames::{Painted, Report};
use serde_json::{Value, json};
use std::time::Duration;

/// One frame that was drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameRecord {
    /// From the end of the wait for the runtime to the end of the frame.
    pub whole: Duration,
    /// From asking where the eyes are to handing the frame to the runtime.
    pub pose_to_submit: Duration,
    /// Time between two frames of the display.
    pub period: Duration,
    /// Frames of the display since the one before that went without a new picture.
    pub missed: u32,
    /// Whether the left and the right hand were tracked.
    pub hands: [bool; 2],
    /// What was drawn.
    pub painted: Painted,
}

/// Value below which a share of the sorted values lies (nearest rank); 0 for no values.
pub fn percentile(sorted: &[f64], share: f64) -> f64 {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied().unwrap_or(0.0)
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Median and tail of a time of all frames, in milliseconds.
fn summary(frames: &[FrameRecord], time: impl Fn(&FrameRecord) -> Duration) -> Value {
    let mut values: Vec<f64> = frames.iter().map(|f| milliseconds(time(f))).collect();
    let first = values.first().copied();
    values.sort_by(f64::total_cmp);
    let at = |share| percentile(&values, share);
    json!({
        "first": first, "p50": at(0.5), "p90": at(0.9), "p95": at(0.95), "p99": at(0.99), "max": at(1.0),
    })
}

/// The frames of a session for `--stats`. Times are in milliseconds.
pub fn report_json(report: &Report) -> Value {
    let frames = &report.frames;
    let sum = |time: fn(&FrameRecord) -> Duration| frames.iter().map(time).sum::<Duration>().as_secs_f64();
    let (trace, whole) = (sum(|f| f.painted.trace), sum(|f| f.whole));
    let chosen = |value: fn(&Painted) -> Value| {
        let mut all: Vec<Value> = Vec::new();
        for frame in frames {
            let value = value(&frame.painted);
            if all.last() != Some(&value) {
                all.push(value);
            }
        }
        all
    };
    json!({
        "frames": frames.len(),
        "empty_frames": report.empty_frames,
        "missed_frames": frames.iter().map(|f| u64::from(f.missed)).sum::<u64>(),
        "display_period_ms": frames.last().map(|f| milliseconds(f.period)),
        "frame_ms": summary(frames, |f| f.whole),
        "pose_to_submit_ms": summary(frames, |f| f.pose_to_submit),
        "gpu_trace_ms": summary(frames, |f| f.painted.trace),
        "gpu_finish_ms": summary(frames, |f| f.painted.finish),
        "place_ms": summary(frames, |f| f.painted.place),
        "share_not_tracing": if whole > 0.0 { json!(1.0 - trace / whole) } else { Value::Null },
        "sizes": chosen(|p| json!(p.size)),
        "bounces": chosen(|p| json!(p.bounces)),
        "session_states": report.states.iter().map(|s| s.name()).collect::<Vec<_>>(),
        "hands_tracked": (0..2).map(|hand: usize| frames.iter().filter(|f| f.hands[hand]).count()).collect::<Vec<_>>(),
        "odd_state_changes": report.odd_changes,
    })
}
