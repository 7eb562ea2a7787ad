//! Measurements: error against run time, with tables and plots of any kind, and how results hold on stiff and extreme
//! input ([`stability`], against [`mod@reference`]).
//!
//! [`profile`] measures frame time over bounces, [`machine`](mod@machine) says on what, [`compare`] sets two profiles side by side, [`heatmap`] shows where in a picture the cost lies. [`convergence`] shows whether defaults are converged. [`accuracy`] puts together what [`geodesics`] measures of integrators in the model geometries and what [`scenes`]
//! measures of pictures, with the errors of [`picture`] (of which one is [`flip`]) and of [`backward`]; [`double`] is the
//! arithmetic of the reference. [`report`] and [`plot`] know nothing of what is measured.

pub mod accuracy;
pub mod backward;
pub mod compare;
pub mod convergence;
pub mod double;
pub mod flip;
pub mod geodesics;
pub mod heatmap;
pub mod machine;
pub mod picture;
pub mod plot;
pub mod profile;
pub mod reference;
pub mod report;
pub mod scenes;
pub mod stability;

/// The value below which the share `q` of the values lies; none of no values. Values that are not numbers count as the
/// largest.
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    sorted.get((q * last as f64).round() as usize).copied()
}

/// Why a measurement could not be made.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// A backend failed.
    #[error(transparent)]
    Render(#[from] crate::render::RenderError),
    /// The device failed.
    #[error(transparent)]
    Vulkan(#[from] crate::vulkan::VulkanError),
    /// A scene does not fit.
    #[error(transparent)]
    World(#[from] crate::render::world::WorldError),
    /// An observer's eye is nowhere.
    #[error(transparent)]
    Eyes(#[from] crate::scene::NoPlaceForEye),
    /// A plot could not be drawn.
    #[error("plot {0}: {1}")]
    Plot(String, String),
}
