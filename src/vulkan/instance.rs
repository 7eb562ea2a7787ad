//! Loader, instance, and the messenger of the validation layer.

use super::{ContextOptions, DeviceInfo, Validation, VulkanError, fault::FaultInjection, tier};
use ash::vk;
use std::{
    ffi::{CStr, CString, c_void},
    io::Write,
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

/// The validation layer.
const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Who makes the handles: the loader, or an OpenXR runtime, which adds extensions and features of its own to the
/// structures it is given (`XR_KHR_vulkan_enable2`) and says which device it needs.
///
/// # Safety
/// The handles returned must be live, made by this process with at least what `info` asks for, and owned by
/// nobody else: the caller destroys them.
pub unsafe trait Creator {
    /// vkCreateInstance.
    ///
    /// # Errors
    /// The driver's or the runtime's.
    fn instance(
        &mut self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
        faults: &FaultInjection,
    ) -> Result<vk::Instance, VulkanError>;

    /// The device that must be taken, if there is no choice.
    ///
    /// # Errors
    /// The runtime's.
    fn physical_device(&mut self, _instance: vk::Instance) -> Result<Option<vk::PhysicalDevice>, VulkanError> {
        Ok(None)
    }

    /// vkCreateDevice.
    ///
    /// # Errors
    /// The driver's or the runtime's.
    fn device(
        &mut self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
        faults: &FaultInjection,
    ) -> Result<vk::Device, VulkanError>;
}

/// The plain loader.
#[derive(Debug)]
pub struct Loader;

// SAFETY: the handles come from vkCreateInstance and vkCreateDevice with the given structures.
unsafe impl Creator for Loader {
    fn instance(
        &mut self,
        entry: &ash::Entry,
        info: &vk::InstanceCreateInfo<'_>,
        faults: &FaultInjection,
    ) -> Result<vk::Instance, VulkanError> {
        // SAFETY: `info` is a complete structure made by `Instance::with_entry`.
        match faults.call("vkCreateInstance", "the program", || unsafe { entry.create_instance(info, None) }) {
            Ok(instance) => Ok(instance.handle()),
            // The loader's way to say that there is no driver at all.
            Err(VulkanError::Call { result: vk::Result::ERROR_INCOMPATIBLE_DRIVER, .. }) => Err(VulkanError::NoDevice),
            Err(error) => Err(error),
        }
    }

    fn device(
        &mut self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
        faults: &FaultInjection,
    ) -> Result<vk::Device, VulkanError> {
        // SAFETY: `physical` belongs to `instance` and `info` is a complete structure made by `Context::new`.
        faults
            .call("vkCreateDevice", "the device", || unsafe { instance.create_device(physical, info, None) })
            .map(|d| d.handle())
    }
}

/// Messages of the validation layer: every warning and error. Clones share their messages and outlive the
/// context, so that what is said at its end can be read.
#[derive(Clone, Debug, Default)]
pub struct Messages(Arc<Mutex<Vec<String>>>);

impl Messages {
    /// All messages so far.
    pub fn all(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// All messages so far, which are forgotten.
    pub fn take(&self) -> Vec<String> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A Vulkan instance.
pub struct Instance {
    entry: ash::Entry,
    handle: ash::Instance,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    /// The messenger holds a pointer to the shared vector: dropped after it.
    messages: Messages,
    debug_names: bool,
    faults: FaultInjection,
    /// Set when something of the instance can no longer be destroyed.
    abandoned: AtomicBool,
}

impl std::fmt::Debug for Instance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Instance").field("messages", &self.messages).finish_non_exhaustive()
    }
}

impl Instance {
    /// Loads Vulkan and makes an instance of version 1.2.
    ///
    /// # Errors
    /// No loader, an old one, a failing driver, or an absent validation layer that is asked for.
    pub fn new(options: &ContextOptions, creator: &mut dyn Creator) -> Result<Self, VulkanError> {
        // Loaded once and never unloaded: drivers leave threads and thread-local data behind.
        static ENTRY: OnceLock<Result<ash::Entry, String>> = OnceLock::new();
        // SAFETY: loading a library runs its initialisers; the Vulkan loader's are harmless.
        let entry = ENTRY.get_or_init(|| unsafe { ash::Entry::load() }.map_err(|e| e.to_string()));
        let entry = entry.as_ref().map_err(|e| VulkanError::NoLoader(e.clone()))?;
        Self::with_entry(entry.clone(), options, creator)
    }

    fn with_entry(entry: ash::Entry, options: &ContextOptions, creator: &mut dyn Creator) -> Result<Self, VulkanError> {
        let faults = options.faults.clone();
        let what = "the program";
        let version = faults.call("vkEnumerateInstanceVersion", what, || {
            // SAFETY: a global function without preconditions.
            unsafe { entry.try_enumerate_instance_version() }
        })?;
        let version = version.unwrap_or(vk::API_VERSION_1_0);
        if version < vk::API_VERSION_1_2 {
            return Err(VulkanError::OldLoader((vk::api_version_major(version), vk::api_version_minor(version))));
        }
        let enumerate = |layer: Option<&CStr>| {
            faults.call("vkEnumerateInstanceExtensionProperties", what, || {
                // SAFETY: `layer` is the name of a layer that is present, or none.
                unsafe { entry.enumerate_instance_extension_properties(layer) }
            })
        };
        let mut available = enumerate(None)?;
        let mut layers = Vec::new();
        let validation = options.validation != Validation::Off;
        if validation {
            // SAFETY: a global function without preconditions.
            let found = faults.call("vkEnumerateInstanceLayerProperties", what, || unsafe {
                entry.enumerate_instance_layer_properties()
            })?;
            if !found.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
                return Err(VulkanError::NoValidation("VK_LAYER_KHRONOS_validation"));
            }
            layers.push(VALIDATION_LAYER.as_ptr());
            available.extend(enumerate(Some(VALIDATION_LAYER))?);
        }
        let has = |name: &CStr| available.iter().any(|e| e.extension_name_as_c_str() == Ok(name));

        let mut extensions: Vec<&CStr> = options.instance_extensions.iter().map(CString::as_c_str).collect();
        let debug_names = has(ash::ext::debug_utils::NAME);
        if debug_names {
            extensions.push(ash::ext::debug_utils::NAME);
        }
        // Devices that are Vulkan with small gaps, such as MoltenVK, are only listed on request.
        let portability = has(ash::khr::portability_enumeration::NAME);
        if portability {
            extensions.push(ash::khr::portability_enumeration::NAME);
        }
        let synchronization = options.validation == Validation::Sync;
        if synchronization {
            if !has(ash::ext::validation_features::NAME) {
                return Err(VulkanError::NoValidation("VK_EXT_validation_features"));
            }
            extensions.push(ash::ext::validation_features::NAME);
        }
        extensions.sort_unstable();
        extensions.dedup();
        let names: Vec<_> = extensions.iter().map(|e| e.as_ptr()).collect();

        let messages = options.messages.clone();
        let application = vk::ApplicationInfo::default()
            .application_name(c"Holonomy")
            .engine_name(c"Holonomy")
            .api_version(vk::API_VERSION_1_2);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&names);
        if portability {
            info = info.flags(vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR);
        }
        let enables = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut checks = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enables);
        if synchronization {
            info = info.push_next(&mut checks);
        }
        // Chained too, for what the layer has to say about creation and destruction of the instance itself.
        let mut early = messenger_info(&messages);
        if validation && debug_names {
            info = info.push_next(&mut early);
        }
        let raw = creator.instance(&entry, &info, &faults)?;
        // SAFETY: `raw` is a live instance that belongs to us (contract of `Creator`).
        let handle = unsafe { ash::Instance::load(entry.static_fn(), raw) };
        let mut instance =
            Self { entry, handle, messenger: None, messages, debug_names, faults, abandoned: AtomicBool::new(false) };
        if validation && debug_names {
            let functions = ash::ext::debug_utils::Instance::new(&instance.entry, &instance.handle);
            let info = messenger_info(&instance.messages);
            let messenger = instance.faults.call("vkCreateDebugUtilsMessengerEXT", what, || {
                // SAFETY: the extension is enabled, and the user data lives until the messenger is destroyed.
                unsafe { functions.create_debug_utils_messenger(&info, None) }
            })?;
            instance.messenger = Some((functions, messenger));
        }
        Ok(instance)
    }

    /// The loader's functions.
    pub fn entry(&self) -> &ash::Entry {
        &self.entry
    }

    /// The instance's functions.
    pub fn raw(&self) -> &ash::Instance {
        &self.handle
    }

    /// Messages of the validation layer.
    pub fn messages(&self) -> &Messages {
        &self.messages
    }

    /// Whether objects can be given names.
    pub(super) fn has_debug_names(&self) -> bool {
        self.debug_names
    }

    /// Gives up destroying the instance: something of it is still at work.
    pub(super) fn abandon(&self) {
        self.abandoned.store(true, Ordering::Relaxed);
    }

    /// All devices.
    ///
    /// # Errors
    /// Driver failures.
    pub fn devices(&self) -> Result<Vec<DeviceInfo>, VulkanError> {
        Ok(self.physical_devices()?.into_iter().map(|(_, info)| info).collect())
    }

    pub(super) fn physical_devices(&self) -> Result<Vec<(vk::PhysicalDevice, DeviceInfo)>, VulkanError> {
        let physical = self.faults.call("vkEnumeratePhysicalDevices", "the program", || {
            // SAFETY: the instance is alive.
            unsafe { self.handle.enumerate_physical_devices() }
        })?;
        physical
            .into_iter()
            .enumerate()
            .map(|(index, physical)| Ok((physical, tier::describe(&self.handle, physical, index, &self.faults)?)))
            .collect()
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if self.abandoned.load(Ordering::Relaxed) {
            // The messenger goes on to use the messages.
            std::mem::forget(self.messages.clone());
            return;
        }
        // SAFETY: everything made from the instance is gone: contexts own the instance and destroy the rest first.
        unsafe {
            if let Some((functions, messenger)) = self.messenger.take() {
                functions.destroy_debug_utils_messenger(messenger, None);
            }
            self.handle.destroy_instance(None);
        }
    }
}

/// Only what the layer says about our use of Vulkan; general messages are the loader's, about drivers that it
/// could not load.
fn messenger_info(messages: &Messages) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Type::VALIDATION | Type::PERFORMANCE)
        .pfn_user_callback(Some(receive))
        .user_data(Arc::as_ptr(&messages.0).cast_mut().cast())
}

/// Called by the validation layer, on any thread that is inside a Vulkan call.
unsafe extern "system" fn receive(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer hands over a valid structure with a terminated text or null, and `user` is the vector of
    // `Messages`, which outlives the messenger.
    let (text, messages) = unsafe {
        let text = data.as_ref().filter(|d| !d.p_message.is_null()).map(|d| CStr::from_ptr(d.p_message));
        (text, user.cast::<Mutex<Vec<String>>>().as_ref())
    };
    let text = text.map_or_else(String::new, |t| t.to_string_lossy().into_owned());
    let level = if severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR) { "error" } else { "warning" };
    // A closed stderr must not unwind into the driver.
    let _ = writeln!(std::io::stderr(), "validation {level}: {text}");
    if let Some(messages) = messages {
        messages.lock().unwrap_or_else(PoisonError::into_inner).push(format!("{level}: {text}"));
    }
    vk::FALSE
}
