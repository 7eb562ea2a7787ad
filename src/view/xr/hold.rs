//! Holding a frame rate by what costs most: pixels and bounces.

use std::time::Duration;

/// Shares of the full width and height that are tried.
const SCALES: &[f64] = &[1.0, 0.9, 0.8, 0.7, 0.6, 0.5];

/// A frame should leave this share of its time unused, for what varies from frame to frame.
const RESERVE: f64 = 0.15;

/// Frames that must be fast before more is tried, so that quality does not flicker.
const CALM_FRAMES: u32 = 30;

/// Chooses resolution and bounces from one frame to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct Hold {
    /// Time of a frame.
    budget: Duration,
    most_bounces: u32,
    scale: usize,
    bounces: u32,
    calm: u32,
}

impl Hold {
    /// Holds `fps` frames per second, with at most the scene's bounces.
    pub fn new(fps: f64, most_bounces: u32) -> Self {
        Self { budget: Duration::from_secs_f64(1.0 / fps), most_bounces, scale: 0, bounces: most_bounces, calm: 0 }
    }

    /// Share of the full width and height.
    pub fn scale(&self) -> f64 {
        SCALES[self.scale]
    }

    /// Largest number of face passages.
    pub fn bounces(&self) -> u32 {
        self.bounces
    }

    /// Fewest bounces: below them a closed space is not recognised.
    fn least_bounces(&self) -> u32 {
        self.most_bounces.min(2)
    }

    /// Takes in what a frame cost. Whether something changes.
    ///
    /// A frame that is too slow gives up distance first and pixels second, in turns, since far copies cover few pixels; frames
    /// that have been fast for a while get back in the opposite order. Nothing is asked for twice in a row.
    pub fn learn(&mut self, frame: Duration) -> bool {
        let share = frame.as_secs_f64() / self.budget.as_secs_f64();
        let before = (self.scale, self.bounces);
        if share > 1.0 - RESERVE {
            self.calm = 0;
            let (far, fine) = (self.bounces > self.least_bounces(), self.scale + 1 < SCALES.len());
            // As much as is needed at once where a frame takes twice its time or more.
            let steps = if share > 2.0 { 2 } else { 1 };
            for _ in 0..steps {
                // By turns: bounces while they are more than the share of pixels that is left.
                let keeps = f64::from(self.bounces) / f64::from(self.most_bounces);
                if far && (keeps >= self.scale().powi(2) || !fine) {
                    self.bounces = (self.bounces * 3 / 4)
                        .max(self.least_bounces())
                        .min(self.bounces - 1)
                        .max(self.least_bounces());
                } else if self.scale + 1 < SCALES.len() {
                    self.scale += 1;
                }
            }
        } else if share < 0.6 {
            self.calm += 1;
            if self.calm >= CALM_FRAMES {
                self.calm = 0;
                let keeps = f64::from(self.bounces) / f64::from(self.most_bounces);
                if self.scale > 0 && (self.scale().powi(2) <= keeps || self.bounces == self.most_bounces) {
                    self.scale -= 1;
                } else if self.bounces < self.most_bounces {
                    self.bounces = (self.bounces + self.bounces / 3).max(self.bounces + 1).min(self.most_bounces);
                }
            }
        } else {
            self.calm = 0;
        }
        before != (self.scale, self.bounces)
    }
}
