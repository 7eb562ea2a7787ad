//! OpenXR: inside a space with a headset. The loader is looked for at run time and only when somebody asks.
//!
//! | module | does |
//! | --- | --- |
//! | [`lifecycle`] | the states of a session and what follows from them |
//! | [`frames`] | the loop of a session over a [`frames::Runtime`], which tests play |
//! | [`system`] | the runtime of the machine, with [`device`] (Vulkan by way of the runtime), [`swapchain`] and [`actions`] |
//! | [`input`] | what buttons mean, and on which controllers they are |
//! | [`player`] | draws: the body in the space, what hangs off it, both eyes |
//! | [`hold`], [`timing`] | holding a frame rate; what frames cost |
//! | [`watchdog`] | ends the program when a runtime does not come back |
//!
//! **How a session ends.** By the number of frames that was asked for, or by the wish of the player, with success; in all
//! other ways with one [`error::XrError`]: the runtime is missing, asleep, gone, or does not answer. Nothing is waited for
//! longer than [`frames::PATIENCE`].

pub mod actions;
pub mod device;
pub mod error;
pub mod frames;
pub mod hold;
pub mod input;
pub mod lifecycle;
pub mod player;
pub mod swapchain;
pub mod system;
pub mod timing;
pub mod watchdog;

use error::XrError;

/// Name and version of the OpenXR runtime.
///
/// # Errors
/// Why there is none, in words.
pub fn runtime() -> Result<String, String> {
    let found = || {
        let instance = system::instance(&system::entry()?, &openxr::ExtensionSet::default())?;
        let properties = instance.properties().map_err(|r| XrError::NoRuntime(r.to_string()))?;
        Ok(format!("{} {}", properties.runtime_name, properties.runtime_version))
    };
    found().map_err(|error: XrError| match error {
        XrError::NoLoader(why) => why,
        other => other.to_string(),
    })
}
