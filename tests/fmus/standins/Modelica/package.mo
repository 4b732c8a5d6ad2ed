within ;
package Modelica "Stand-in for the tests: the few classes that ZeroshotRoom uses, with the same names and interfaces"
  package Constants "Constants"
    constant Real pi = 3.141592653589793;
    constant Real sigma = 5.670374419e-8;
  end Constants;
  package Blocks "Signals"
    package Interfaces
      connector RealInput = input Real;
      connector RealOutput = output Real;
    end Interfaces;
    package Sources
      block RealExpression
        Modelica.Blocks.Interfaces.RealOutput y = 0.0;
      end RealExpression;
    end Sources;
    package Routing
      block RealPassThrough
        Modelica.Blocks.Interfaces.RealInput u;
        Modelica.Blocks.Interfaces.RealOutput y;
      equation
        y = u;
      end RealPassThrough;
    end Routing;
    package Math
      block Add
        Modelica.Blocks.Interfaces.RealInput u1;
        Modelica.Blocks.Interfaces.RealInput u2;
        Modelica.Blocks.Interfaces.RealOutput y;
      equation
        y = u1 + u2;
      end Add;
    end Math;
  end Blocks;
  package Thermal
    package HeatTransfer
      package Interfaces
        connector HeatPort_a
          Real T;
          flow Real Q_flow;
        end HeatPort_a;
        connector HeatPort_b
          Real T;
          flow Real Q_flow;
        end HeatPort_b;
      end Interfaces;
      package Components
        model HeatCapacitor
          parameter Real C;
          Real T(start=293.15);
          Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_a port;
        equation
          T = port.T;
          C*der(T) = port.Q_flow;
        end HeatCapacitor;
        model ThermalResistor
          parameter Real R;
          Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_a port_a;
          Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_b port_b;
        equation
          R*port_a.Q_flow = port_a.T - port_b.T;
          port_a.Q_flow + port_b.Q_flow = 0;
        end ThermalResistor;
      end Components;
      package Sources
        model PrescribedHeatFlow
          Modelica.Blocks.Interfaces.RealInput Q_flow;
          Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_b port;
        equation
          port.Q_flow = -Q_flow;
        end PrescribedHeatFlow;
        model PrescribedTemperature
          Modelica.Blocks.Interfaces.RealInput T;
          Modelica.Thermal.HeatTransfer.Interfaces.HeatPort_b port;
        equation
          port.T = T;
        end PrescribedTemperature;
      end Sources;
    end HeatTransfer;
  end Thermal;
  package Fluid
    package Types
      type Dynamics = enumeration(DynamicFreeInitial, FixedInitial, SteadyStateInitial, SteadyState);
    end Types;
  end Fluid;
  package Media
    package Interfaces
      partial package PartialMedium
      end PartialMedium;
    end Interfaces;
    package IdealGases
      package Common
        package SingleGasesData
          record GasData
            constant Real MM = 0.0440095;
          end GasData;
          constant GasData CO2;
        end SingleGasesData;
      end Common;
    end IdealGases;
  end Media;
end Modelica;
