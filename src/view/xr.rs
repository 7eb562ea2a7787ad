//! OpenXR. The loader is looked for at run time and only when somebody asks.

/// Name and version of the OpenXR runtime.
///
/// # Errors
/// Why there is none, in words.
pub fn runtime() -> Result<String, String> {
    // SAFETY: loading runs the initialisers of the library that the system names libopenxr_loader, which conforms to
    // the OpenXR specification; it is loaded for this question only.
    let entry = unsafe { openxr::Entry::load(&()) }.map_err(|_| String::from("no loader on this machine"))?;
    let application = openxr::ApplicationInfo {
        application_name: "holonomy",
        application_version: 1,
        engine_name: "holonomy",
        engine_version: 1,
        api_version: openxr::Version::new(1, 0, 0),
    };
    let instance = entry
        .create_instance(&application, &openxr::ExtensionSet::default(), &[], &())
        .map_err(|error| format!("no runtime ({error})"))?;
    let properties = instance.properties().map_err(|error| format!("no runtime ({error})"))?;
    Ok(format!("{} {}", properties.runtime_name, properties.runtime_version))
}
