//! Functions of the standards that a skydiver does not support. Every function must exist, so these return an error.
//!
//! They are declared without parameters, which is harmless: in C, the caller removes its arguments from the stack.

use std::ffi::c_void;
use std::ptr;

use crate::instance::ERROR;

macro_rules! unsupported {
    ($($name:ident)*) => {
        $(
            /// Not supported.
            #[unsafe(no_mangle)]
            pub extern "C" fn $name() -> i32 {
                ERROR
            }
        )*
    };
}

unsupported! {
    fmi3GetFloat32
    fmi3GetInt8
    fmi3GetUInt8
    fmi3GetInt16
    fmi3GetUInt16
    fmi3GetInt32
    fmi3GetUInt32
    fmi3GetInt64
    fmi3GetUInt64
    fmi3GetBoolean
    fmi3GetString
    fmi3GetBinary
    fmi3GetClock
    fmi3SetFloat32
    fmi3SetInt8
    fmi3SetUInt8
    fmi3SetInt16
    fmi3SetUInt16
    fmi3SetInt32
    fmi3SetUInt32
    fmi3SetInt64
    fmi3SetUInt64
    fmi3SetBoolean
    fmi3SetString
    fmi3SetBinary
    fmi3SetClock
    fmi3GetNumberOfVariableDependencies
    fmi3GetVariableDependencies
    fmi3SerializedFMUStateSize
    fmi3SerializeFMUState
    fmi3DeserializeFMUState
    fmi3GetDirectionalDerivative
    fmi3GetAdjointDerivative
    fmi3EnterConfigurationMode
    fmi3ExitConfigurationMode
    fmi3GetIntervalDecimal
    fmi3GetIntervalFraction
    fmi3GetShiftDecimal
    fmi3GetShiftFraction
    fmi3SetIntervalDecimal
    fmi3SetIntervalFraction
    fmi3SetShiftDecimal
    fmi3SetShiftFraction
    fmi3EvaluateDiscreteStates
    fmi3UpdateDiscreteStates
    fmi3EnterContinuousTimeMode
    fmi3CompletedIntegratorStep
    fmi3SetTime
    fmi3SetContinuousStates
    fmi3GetContinuousStateDerivatives
    fmi3GetEventIndicators
    fmi3GetContinuousStates
    fmi3GetNominalsOfContinuousStates
    fmi3GetNumberOfEventIndicators
    fmi3GetNumberOfContinuousStates
    fmi3EnterStepMode
    fmi3EnterEventMode
    fmi3GetOutputDerivatives
    fmi3ActivateModelPartition
    fmi2GetInteger
    fmi2GetBoolean
    fmi2GetString
    fmi2SetInteger
    fmi2SetBoolean
    fmi2SetString
    fmi2SerializedFMUstateSize
    fmi2SerializeFMUstate
    fmi2DeSerializeFMUstate
    fmi2GetDirectionalDerivative
    fmi2SetRealInputDerivatives
    fmi2GetRealOutputDerivatives
    fmi2CancelStep
    fmi2GetStatus
    fmi2GetIntegerStatus
    fmi2GetStringStatus
}

/// Not supported: a skydiver is a co-simulation unit.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateModelExchange() -> *mut c_void {
    ptr::null_mut()
}

/// Not supported: a skydiver is a co-simulation unit.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3InstantiateScheduledExecution() -> *mut c_void {
    ptr::null_mut()
}
